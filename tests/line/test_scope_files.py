"""Scope files of every layout. The headers are synthetic, written here from public manuals."""

import io
import os
import pickle
import tempfile
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shipnet.errors import ArgumentError, InputError
from shipnet.line import Waveform

N = 60
DT = 1e-7
T = np.arange(N) * DT - 2e-6
V = np.round(30 + 2 * np.sin(np.arange(N) / 5), 3)


def rows(line, end="\n", time=1.0, volt=1.0):
    return "".join(
        line.format(t=t * time, v=v * volt, k=k) + end
        for k, (t, v) in enumerate(zip(T, V, strict=True))
    )


TDS = ["Record Length,6.0e+01", "Sample Interval,1.000000e-07", "Trigger Point,3.0e+01", ","]
TDS += [",", ",", "Source,CH1", "Vertical Units,V", "Vertical Scale,5.0e+00"]

SYNTHETIC = {
    "tektronix_mdo": "Model,MDO4014B-3\nFirmware Version,3.22\n\nWaveform Type,ANALOG\n"
    "Horizontal Units,s\nHorizontal Scale,4e-05\nSample Interval,1e-07\nRecord Length,60\n"
    "Probe Attenuation,10\nVertical Units,V\nVertical Offset,0\n,\n,\nLabel,\nTIME,CH1\n"
    + rows("{t:.7e},{v:.3f}"),
    "tektronix_tds": "".join(
        f"{TDS[k] if k < len(TDS) else ','},,{t:.12f},{v:10.5f},\n"
        for k, (t, v) in enumerate(zip(T, V, strict=True))
    ),
    "tektronix_hash": "#Model,MDO3014\n#\n#Sample Interval,1e-07,\n#Label,A,\n#TIME,CH1,\n"
    + rows("{t:.8e},{v:.3f},"),
    "keysight": "x-axis,1\nsecond,Volt\n" + rows("{t:+.5E},{v:+.4E}"),
    "rigol_increment": "X,CH1,Start,Increment,\nSequence,Volt,-2.000000e-06,1.000000e-07\n"
    + rows("{k},{v:.3f},,"),
    "rigol_pod": "X,CH1,D7-D0,Start,Increment,\nSequence,Volt,,-2.000000e-06,1.000000e-07\n"
    + rows("{k},{v:.3f},0x00,,"),
    "rigol_old": "Time,X(CH1),\nSecond,Volt,\n" + rows("{t:.7e},{v:.5e},"),
    "rigol_5000": "CH1V,t0 =-2e-6, tInc = 1e-07,\n" + rows("{v:.3f},,"),
    "siglent": "Record Length,Analog:60\nSample Rate,10000000.0\nVertical Scale,CH1: 0.05\n"
    "Vertical Offset,CH1:0.00000\nHorizontal Scale, 0.000010000\nSecond,Volt\n"
    + rows("{t:.11f},{v:.5f}"),
    "lecroy": "LECROYWS3024,Waveform\r\nSegments,1,SegmentSize,60\r\n"
    "Segment,TrigTime,TimeSinceSegment1\r\n#1,21 Mar 1990 9:37:08,0\r\nTime,Ampl\r\n"
    + rows("{t:.8e},{v:.5f}", end="\r\n"),
    "picoscope": "\ufeffTime,Channel A\n(us),(mV)\n\n"
    + rows("{t:.3f},{v:.1f}", time=1e6, volt=1e3),
    "picoscope_german": "Time;Channel A\r\n(µs);(V)\r\n\r\n"
    + rows("{t:.3f};{v:.3f};", end="\r\n", time=1e6).replace(".", ","),
    "picoscope_tabs": "Time\tChannel A\n(ms)\t(V)\n\n"
    + rows("{t:.5f}\t{v:.3f}", time=1e3).replace(".", ","),
    "rohde_schwarz": "in s,C1 in V\n" + rows("{t:.7e},{v:.3f}"),
    "digilent": "#Digilent WaveForms Oscilloscope Acquisition\n#Samples: 60\n"
    "#Sample rate: 1e+07Hz\n\nTime (s),Channel 1 (V)\n" + rows("{t:.8f},{v:.3f}"),
    "owon": "#,Time(us),CH1(mV)\n" + rows("{k},{t:.4f},{v:.2f}", time=1e6, volt=1e3),
    "owon_backwards": "#,Time(us),CH1(V)\n"
    + "".join(f"{k},{T[-1 - k] * 1e6:.4f},{V[-1 - k]:.3f}\n" for k in range(N)),
    "simulator": '"Time [ms]", "R1.V [V]"\n' + rows("{t:.5f},{v:.3f}", time=1e3),
    "blanks": rows("{t:.8f}  {v:.3f}"),
    "one_column": "Sampling Rate: 10.000MSa/s\nVoltage(mV)\n" + rows("{v:.1f}", volt=1e3),
    "blank_lines": "Time,CH1\n\n" + rows("{t:.8f},{v:.3f}", end="\n\n") + ",,\n",
    "typographic_minus": "Time;CH1\n" + rows("{t:.8f};{v:.3f}").replace("-", "\u2212"),
    "old_mac": "Time,CH1\r" + rows("{t:.8f},{v:.3f}", end="\r"),
}


@pytest.fixture
def save(tmp_path):
    def save(content, name="scope.csv"):
        file = tmp_path / name
        file.write_bytes(content if isinstance(content, bytes) else content.encode())
        return file

    return save


def refused(file, **options):
    with pytest.raises(InputError) as refusal:
        Waveform.read(file, **options)
    message = str(refusal.value)
    assert message.startswith(f"{file}: ")
    assert "\n" not in message
    return message.removeprefix(f"{file}: ")


@pytest.mark.parametrize("layout", SYNTHETIC)
def test_every_layout_has_the_same_waveform(layout, save):
    waveform = Waveform.read(save(SYNTHETIC[layout]))
    assert waveform.u == pytest.approx(V, abs=1e-9)
    assert waveform.dt == pytest.approx(DT, rel=1e-6)
    assert "60 samples at 10 MS/s" in waveform.description


@pytest.mark.parametrize("encoding", ["utf-16", "latin-1", "utf-8-sig"])
def test_encodings(encoding, save):
    waveform = Waveform.read(save(SYNTHETIC["picoscope_german"].encode(encoding)))
    assert waveform.names[0] == "Channel A"
    assert waveform.u == pytest.approx(V)


def test_titles_are_found():
    named = {"tektronix_mdo": "CH1", "keysight": "1", "rigol_increment": "CH1", "lecroy": "Ampl"}
    named |= {"siglent": "column 2", "rohde_schwarz": "C1", "digilent": "Channel 1"}
    with tempfile.TemporaryDirectory() as folder:
        for layout, title in named.items():
            file = Path(folder, "a.csv")
            file.write_text(SYNTHETIC[layout], encoding="utf-8")
            assert Waveform.read(file).names[0] == title


def test_a_channel_is_chosen_by_title_or_number(save):
    two = "Time,Channel A,Channel B\n(us),(mV),(V)\n" + rows("{t:.3f},5,{v:.3f}", time=1e6)
    for channel in ("Channel B", "channel b", "3"):
        assert Waveform.read(save(two), channel=channel).u == pytest.approx(V)
    assert Waveform.read(save(two)).u == pytest.approx(0.005)
    assert "its channels are Channel A, Channel B" in refused(save(two), channel="C")


def test_off_the_scale_is_clipped(save):
    text = "Time,Channel A\n(us),(V)\n" + rows("{t:.3f},{v:.3f}", time=1e6).replace("31.999", "∞")
    u = Waveform.read(save(text)).u
    assert np.isfinite(u).all()
    assert u.max() == np.sort(V[V < 31.999])[-1]


def test_times_printed_with_few_digits_are_even_enough(save):
    coarse = "".join(f"{0.01 + k * DT:.6g},{v}\n" for k, v in enumerate(V))
    assert Waveform.read(save("Time,CH1\n" + coarse)).dt == pytest.approx(DT, rel=0.02)


def test_a_sample_interval_given_overrides_the_file(save):
    assert Waveform.read(save(SYNTHETIC["keysight"]), sample_interval=5e-8).dt == 5e-8
    assert Waveform.read(save(rows("{v:.3f}")), sample_interval=DT).u == pytest.approx(V)
    with pytest.raises(ArgumentError, match="sample_interval is 0"):
        Waveform.read(save("1"), sample_interval=0)


def test_bad_cells_are_all_named(save):
    lines = ("Time,CH1\n" + rows("{t:.8f},{v:.3f}")).split("\n")
    lines[20], lines[30], lines[40] = "x,1", "0.5", "1_0,nan"
    message = refused(save("\n".join(lines)))
    assert message == (
        "row 21, column 1: 'x' is not a number; row 31, column 2 is empty; "
        "row 41, column 1: '1_0' is not a number; row 41, column 2: 'nan' is not a number"
    )
    lines[10:40] = ["-,-"] * 30
    message = refused(save("\n".join(lines)))
    assert message == (
        "rows 11 to 15, column 1: '-' is not a number; "
        "rows 11 to 15, column 2: '-' is not a number; and 52 more"
    )


def test_uneven_times_are_located(save):
    lines = rows("{t:.8f},{v:.3f}").split("\n")
    del lines[20:22]
    message = refused(save("Time,CH1\n" + "\n".join(lines)))
    assert message == "sample 21 comes 300 ns after the previous one, not 100 ns"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "the file is empty"),
        (b" \r\n\n", "the file is empty"),
        (b"\0\1\2\3", "not text"),
        (b"hello\nworld\n", "no column of numbers"),
        (b"Time,CH1\n1e-7,2.0\n", "number of samples is 1"),
        (rows("{v:.3f}"), "it has no times"),
        ("Time (s),I (A)\n" + rows("{t:.8f},{v:.3f}"), "no voltage column"),
        ("Time\n" + rows("{t:.8f}"), "no voltage column"),
        ("Time,CH1\n" + rows("{t:.8f},{v:.3f}", time=100), "it was sampled at 0.1 MS/s"),
        ("Time,CH1\n" + rows("0.5,{v:.3f}"), "its times do not increase"),
        ("Time,CH1\n" + rows("{t:.8f},∞"), "off the scale throughout"),
        ("x\n" * 3000 + rows("{t:.8f},{v:.3f}"), "no row of numbers in the first 2000 rows"),
    ],
)
def test_bad_text(content, message, save):
    assert message in refused(save(content))


def test_paths_that_are_not_files(tmp_path):
    assert "No such file" in refused(tmp_path / "none.csv")
    assert "not a file" in refused(tmp_path)
    os.mkfifo(tmp_path / "pipe.csv")
    assert "not a file" in refused(tmp_path / "pipe.csv")


def test_an_error_survives_pickling():
    fault = pickle.loads(pickle.dumps(InputError("a.csv", "row 1", more=3)))
    assert str(fault) == "a.csv: row 1; and 3 more"


def test_numpy_files(tmp_path):
    np.save(tmp_path / "u.npy", V)
    assert Waveform.read(tmp_path / "u.npy", sample_interval=DT).u == pytest.approx(V)
    assert "it has no times" in refused(tmp_path / "u.npy")
    for array in (np.column_stack([T, V]), np.stack([T, V]).astype(np.float32)):
        np.save(tmp_path / "tu.npy", array)
        assert Waveform.read(tmp_path / "tu.npy").dt == pytest.approx(DT, rel=1e-4)
    np.savez(tmp_path / "tv.npz", t=T, v=np.column_stack([V, -V]), probes=["n0", "n5"])
    assert Waveform.read(tmp_path / "tv.npz", channel="n5").u == pytest.approx(-V)
    np.savez_compressed(tmp_path / "du.npz", dt=DT, u=V)
    assert Waveform.read(tmp_path / "du.npz").dt == DT


@pytest.mark.parametrize(
    ("array", "message"),
    [
        (np.array(["a"]), "expected real numbers"),
        (np.zeros(0), "expected real numbers"),
        (np.zeros((2, 2, 2)), "expected voltages, or time and voltages"),
        (np.zeros(5, dtype=complex), "expected real numbers"),
        (np.array([{}]), "not a complete .npy file"),
    ],
)
def test_bad_numpy_files(array, message, tmp_path):
    np.save(tmp_path / "a.npy", array, allow_pickle=True)
    assert message in refused(tmp_path / "a.npy")
    if array.ndim < 3 and message.startswith("expected real"):
        np.savez(tmp_path / "a.npz", t=T, u=array)
        assert message in refused(tmp_path / "a.npz")


def test_npz_without_voltage_or_with_other_times(tmp_path):
    np.savez(tmp_path / "a.npz", x=V)
    assert "expected the voltages as u or v" in refused(tmp_path / "a.npz")
    np.savez(tmp_path / "a.npz", t=T[:5], u=V)
    assert "t has the shape (5,)" in refused(tmp_path / "a.npz")
    np.savez(tmp_path / "a.npz", dt=-1.0, u=V)
    assert "dt is not a single positive number" in refused(tmp_path / "a.npz")


def session(parts, rate="10 MHz", number=1, extra="", more=()):
    """A sigrok session as PulseView stores it; analog channels are numbered after logic ones."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("version", "2")
        archive.writestr(
            "metadata",
            f"[global]\nsigrok version=0.5.2\n\n[device 1]\nsamplerate={rate}\n{extra}"
            f"total analog=1\nanalog{number}=AS-i\n",
        )
        for place, part in enumerate(parts, start=1):
            if part is not None:
                archive.writestr(f"analog-1-{number}-{place}", np.asarray(part, "<f4").tobytes())
        for name, content in more:
            archive.writestr(name, content)
    return stream.getvalue()


def test_a_sigrok_session_of_many_parts(save):
    file = save(session(np.split(V, 12), number=9, extra="total probes=8\nunitsize=1\n"), "a.sr")
    waveform = Waveform.read(file)
    assert waveform.u == pytest.approx(V, abs=1e-5)
    assert (waveform.dt, waveform.names) == (DT, ("AS-i",))


def test_a_sigrok_session_has_nan_where_nothing_was_recorded(save):
    waveform = Waveform.read(save(session([V, np.full(N, np.nan), V]), "a.sr"))
    assert np.isnan(waveform.u).sum() == N


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (session([V])[:-30], "not a complete .sr file"),
        (session([V, None, V]), "a part of analog-1-1 is missing"),
        (session([]), "no analog channel"),
        (session([V], rate="fast"), "it has no times"),
        (session([V], rate="200 kHz"), "it was sampled at 0.2 MS/s"),
        (session([np.full(N, np.nan)]), "has no numbers"),
    ],
)
def test_bad_sigrok_sessions(content, message, save):
    assert message in refused(save(content, "a.sr"))


def test_an_archive_of_many_parts_that_unpack_to_too_much_is_refused(save):
    # Each part is small; only their sum is too large: 5.2 million numbers in 0.03 MB.
    message = refused(save(session([np.zeros(2**20)] * 5), "a.sr"))
    assert "it unpacks to 5242880 numbers; at most 4194304 are read" in message


def test_an_npz_archive_that_unpacks_to_too_much_is_refused(tmp_path):
    # Integers of one byte become eight times as large.
    np.savez_compressed(tmp_path / "a.npz", u=np.zeros(2**22 + 1, dtype=np.int8), dt=1e-7)
    assert "it unpacks to 4194306 numbers; at most 4194304" in refused(tmp_path / "a.npz")


def test_an_array_of_too_many_channels_is_refused(tmp_path):
    for suffix, shape in ((".npz", (2, 1025)), (".npy", (1026, 1026))):
        path, values = tmp_path / f"a{suffix}", np.zeros(shape)
        np.savez(path, u=values, dt=1e-7) if suffix == ".npz" else np.save(path, values)
        message = refused(path)
        assert f"has the shape {shape}; expected" in message and "at most 1024 channels" in message
    np.savez(tmp_path / "a.npz", u=np.zeros((2, 1024)), dt=1e-7)
    assert Waveform.read(tmp_path / "a.npz", channel="u1023").u.tolist() == [0, 0]


def test_only_the_wanted_channel_is_unpacked(save, tmp_path, monkeypatch):
    monkeypatch.setattr("shipnet.line.scope_file.MOST_NUMBERS", 2 * N)
    monkeypatch.setattr("shipnet.line.scope_file.MOST_PER_BYTE", 0)
    other = [("analog-1-2-1", np.asarray(-V, "<f4").tobytes())]
    file = save(session([V], extra="analog2=other\n", more=other), "a.sr")
    for channel, sign in (("AS-i", 1), ("other", -1)):
        assert Waveform.read(file, channel=channel).u == pytest.approx(sign * V, abs=1e-5)
    np.savez(tmp_path / "a.npz", u=V, dt=DT, photo=np.zeros(10 * N))
    assert Waveform.read(tmp_path / "a.npz").u == pytest.approx(V)


def test_a_session_with_a_large_description_is_refused(save):
    assert "its metadata has more than" in refused(save(session([V], extra="x" * 2**21), "a.sr"))


def stored(kind):
    stream = io.BytesIO()
    if kind == ".sr":
        return session([V])
    if kind == ".npz":
        np.savez(stream, t=T, u=V)
    elif kind == ".npy":
        np.save(stream, np.column_stack([T, V]))
    else:
        return SYNTHETIC["picoscope"].encode()
    return stream.getvalue()


@pytest.mark.parametrize("kind", [".csv", ".txt", ".npy", ".npz", ".sr", ""])
@given(data=st.data())
@settings(max_examples=60)
def test_hostile_bytes_are_refused_or_read(kind, data):
    good = stored(kind)
    content = data.draw(
        st.one_of(
            st.binary(max_size=300),
            st.text("0123456789.,;+-eE\t\n \"'xinf", max_size=300).map(str.encode),
            st.tuples(st.integers(0, len(good) - 1), st.binary(min_size=1, max_size=4)).map(
                lambda change: good[: change[0]] + change[1] + good[change[0] + len(change[1]) :]
            ),
            st.integers(0, len(good)).map(lambda length: good[:length]),
        )
    )
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, f"a{kind}")
        file.write_bytes(content)
        try:
            waveform = Waveform.read(file)
        except InputError:
            return
    assert waveform.u.ndim == 1
    assert 0 < waveform.dt <= 1.001e-6
