"""How much faster two Dask workers are than one, for rare errors and for writing fleet files.

Wall times are meaningful only on an idle machine. On any machine, the CPU time of a single worker,
divided by that of the busier of two, shows how evenly the work is shared. Workers are warmed up
before they are timed.
"""

import os
import tempfile
from functools import partial
from time import perf_counter, process_time

from distributed import Client, LocalCluster

from shipnet import asi
from shipnet.asi.emc.rare_errors import rare_error_rates
from shipnet.ballast.fleet import write_fleet

TURNS = 1


def rates(workers, folder, n=250_000):
    waves = {"line": asi.line(100, slaves=(5,)).waveform()}
    density = asi.emc.Noise().density([0.3, 0.4])
    proof = asi.RECEIVERS["noise-proof"]
    return rare_error_rates(waves, density, n, receiver=proof, workers=workers)


def fleet(workers, folder, valves=400, days=10):
    return write_fleet(folder, valves, days, workers=workers)


def busy(client):
    """Return the CPU time that each worker has used so far [s]."""
    return client.run(process_time)


def main():
    jobs = {
        "rare errors": (rates, partial(rates, n=20_000)),
        "fleet": (fleet, partial(fleet, valves=100, days=1)),
    }
    print(f"machine load before the run: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    for turn in range(TURNS):
        for name, (job, warm) in jobs.items():
            wall, cpu, results = {}, {}, []
            for n in (1, 2):
                with (
                    LocalCluster(
                        n_workers=n,
                        threads_per_worker=1,
                        dashboard_address="127.0.0.1:0",
                        silence_logs=50,
                    ) as cluster,
                    Client(cluster) as client,
                    tempfile.TemporaryDirectory() as folder,
                ):
                    client.wait_for_workers(n)
                    for place in range(2):
                        warm(client.get_executor(pure=False).map, f"{folder}/warm-{place}")
                    before, begin = busy(client), perf_counter()
                    results.append(job(client.get_executor(pure=False).map, f"{folder}/fleet"))
                    wall[n], after = perf_counter() - begin, busy(client)
                    cpu[n] = max(after[worker] - before[worker] for worker in after)
            assert results[0].equals(results[1])
            print(
                f"turn {turn + 1}, {name}: one worker {wall[1]:.1f} s, {cpu[1]:.1f} s of CPU; "
                f"two workers {wall[2]:.1f} s, the busier {cpu[2]:.1f} s of CPU; "
                f"{wall[1] / wall[2]:.2f}x wall, {cpu[1] / cpu[2]:.2f}x CPU",
                flush=True,
            )


if __name__ == "__main__":
    main()
