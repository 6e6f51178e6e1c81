// The drawing of the AS-i bench. While a device is dragged, its place goes to the kernel, one request
// at a time; the newest place waits. All results come from the kernel, as text and as float32 arrays.

const LEFT = 40, RIGHT = 18, CABLE = 68, STRIP = 148, HEIGHT = 196; // of the drawing [px]
const LANES = { scope: 10, supply: 29, master: 48, slave: 88 }; // y of a device; others are on the cable
const SPUR = 1.2, LONGEST = 30; // px per metre, and longest spur that a drag makes [m]
const ROUND = "M-6 0A6 6 0 1 0 6 0A6 6 0 1 0-6 0z";
const DOT = "m-3 0a3 3 0 1 0 6 0a3 3 0 1 0-6 0z", SQUARE = "m-3-3h6v6h-6z", CROSS = "m-3-3l6 6m0-6l-6 6";
const SHAPES = {
  scope: "M0 8L-6-1V-8H6V-1z", supply: "M0 8L-9-7H9z", master: "M-7-7H7V7H-7z", slave: ROUND,
  repeater: "M0-11L11 0 0 11-11 0z", terminator: "M-4-11H4V11H-4z", resistor: "M-4-11H4V11H-4z",
  failing: "M-7-4L-4-7 0-3 4-7 7-4 3 0 7 4 4 7 0 3-4 7-7 4-3 0z",
};
const PINS = [["#8e5bb5", "8 3"], ["#0f8a6d", "3 3"], ["#b07000", "9 3 2 3"], ["#a0523d", "1 3"]];

const clip = (value, low, high) => Math.min(high, Math.max(low, value));
const safe = (text) => String(text).replace(/[&<>"]/g, (c) => `&#${c.charCodeAt(0)};`);
const color = (name) => `var(--shipnet-${name})`;
const words = (x, y, text, look = "") => `<text x="${x}" y="${y}" ${look}>${safe(text)}</text>`;
const path = (d, look, x = 0, y = 0) => `<path transform="translate(${x} ${y})" d="${d}" ${look}/>`;
const stroke = (d, name, look = "") => path(d, `fill="none" stroke="${color(name)}" ${look}`);
const write = ({ kind, place, spur }) => `${kind}@${place}${spur ? `/${spur}` : ""}`;

function read(text) {
  const [, kind, place, spur] = /^(\w+)@([\d.]+)(?:\/([\d.]+))?$/.exec(text);
  return { kind, place: +place, spur: +(spur || 0) };
}

function ticks([low, high], most) {
  const rough = (high - low) / most, power = 10 ** Math.floor(Math.log10(rough));
  const step = power * [1, 2, 5, 10].find((factor) => factor * power >= rough);
  const first = Math.ceil(low / step - 1e-9), last = Math.floor(high / step + 1e-9);
  return Array.from({ length: last - first + 1 }, (_, k) => +((first + k) * step).toPrecision(6));
}

// Draw a chart: `lines` have x(k), y and a look; `marks` have points, a shape and a look.
function chart(svg, width, height, { title, note, bad, xs, ys, unit, lines, marks, limits }) {
  const narrow = width < 560, top = narrow ? 34 : 20, full = height + top - 20;
  const low = full - (unit ? 18 : 4), right = width - RIGHT;
  const px = (x) => (LEFT + (x - xs[0]) / (xs[1] - xs[0]) * (right - LEFT)).toFixed(1);
  const py = (y) => (low - (clip(y, ...ys) - ys[0]) / (ys[1] - ys[0]) * (low - top)).toFixed(1);
  const shown = (x, y) => x <= xs[1] && !Number.isNaN(y);
  const columns = ticks(xs, width / 80), rows = ticks(ys, (low - top) / 22), across = (y) => `M${LEFT} ${py(y)}H${right}`;
  const parts = [words(0, 12, title), words(narrow ? 0 : right, narrow ? 26 : 12, note,
    `text-anchor="${narrow ? "start" : "end"}" fill="${color(bad ? "bad" : "ink")}"`),
  stroke([...columns.map((x) => `M${px(x)} ${top}V${low}`), ...rows.map(across)].join(""), "line"),
  stroke(limits.map(across).join(""), "bad", 'stroke-dasharray="5 3"'),
  ...rows.map((y) => words(LEFT - 6, +py(y) + 4, y, 'text-anchor="end"'))];
  if (unit) parts.push(words(0, low + 14, unit), ...columns.map((x) => words(px(x), low + 14, x, 'text-anchor="middle"')));
  for (const { x, y, look } of lines) {
    const point = (value, k) => (shown(x(k), value) ? `${k && shown(x(k), y[k - 1]) ? "L" : "M"}${px(x(k))} ${py(value)}` : "");
    parts.push(path(Array.from(y, point).join(""), `fill="none" ${look}`));
  }
  for (const { points, shape, look } of marks) {
    const visible = points.filter(([x, y]) => shown(x, y));
    parts.push(path(visible.map(([x, y]) => `M${px(x)} ${py(y)}${shape}`).join(""), look));
  }
  svg.setAttribute("height", full);
  svg.setAttribute("aria-label", `${title}: ${note}`);
  svg.innerHTML = parts.join("");
}

function render({ model, el }) {
  const { limits, kinds } = model.get("legend");
  const state = { devices: [], sender: 1 }; // as drawn, which may be ahead of the last answer
  let answer = null, broken = [], pins = [], spots = [], drag = null, chosen = 0;
  let asked = 0, busy = false, waiting = null, since = 0, sent = 0, width = 800;

  el.classList.add("shipnet-bench");
  el.innerHTML = `<div class="shipnet-row" role="toolbar" aria-label="Change the devices"></div>
    <svg class="shipnet-cable" role="group" aria-label="The cable and its devices"><g></g><g></g><g></g></svg>
    <p class="shipnet-fault" role="alert"></p><svg role="img"></svg><svg role="img"></svg><svg role="img"></svg><div></div>`;
  const [bar, cable, fault, volts, strengths, wave, pinned] = el.children;
  const [base, devices, strip] = cable.children;
  const length = () => answer.state.length;
  const px = (metre) => LEFT + Math.min(metre, length()) / length() * (width - LEFT - RIGHT);
  const slaves = () => state.devices.flatMap(({ kind }, k) => (kind === "slave" ? [k] : []));
  const places = (kind) => state.devices.filter((one) => one.kind === kind).map((one) => one.place);
  const name = (k) => {
    const { kind } = state.devices[k], nth = slaves().indexOf(k);
    return nth < 0 ? kinds[kind][2] : `slave ${answer.labels[nth] ?? nth + 1}`;
  };

  // Requests and answers ---------------------------------------------------------------------

  function ask(final, change = { devices: state.devices.map(write), sender: state.sender }, at = performance.now()) {
    waiting = { final, change, at };
    if (!busy) send();
  }
  function send() {
    const { final, change, at } = waiting;
    [busy, waiting, since, sent, asked] = [true, null, at, performance.now(), asked + 1];
    model.send({ asked, final, change });
  }
  function receive(message, buffers) {
    const own = message.asked === asked;
    if (own) busy = false;
    fault.textContent = message.fault || "";
    if (!message.fault) {
      const arrays = message.names.map((key, k) => {
        const { buffer, byteOffset, byteLength } = buffers[k];
        return [key, new Float32Array(buffer.slice(byteOffset, byteOffset + byteLength))];
      });
      answer = { ...message, ...Object.fromEntries(arrays) };
      broken = message.broken ?? broken;
      // While the user is ahead, an answer does not move the devices back.
      if (!drag && !waiting && !busy) {
        state.devices = answer.state.devices.map(read);
        state.sender = answer.sending + 1;
      }
      el.closest(".shipnet-page").classList.toggle("shipnet-moving", !message.broken);
      draw();
      if (own) performance.measure("shipnet-bench", { start: since, detail: { sent, kernel: message.seconds } });
    }
    if (waiting && !busy) send();
  }

  // Pictures ---------------------------------------------------------------------------------

  function draw() {
    chosen = Math.min(chosen, state.devices.length - 1);
    drawCable();
    drawCharts();
    const { kind } = state.devices[chosen];
    for (const one of bar.querySelectorAll("[data-add]")) one.disabled = places(one.dataset.add).length >= kinds[one.dataset.add][1];
    remove.disabled = places(kind).length <= kinds[kind][0];
    remove.title = `Remove the ${name(chosen)}, or press Delete.`;
    if (document.activeElement !== count) count.value = slaves().length;
  }

  function drawCable() {
    const ends = [0, ...places("repeater").sort((a, b) => a - b), length()];
    const columns = ticks([0, length()], width / 80);
    const parts = [words(0, HEIGHT - 3, "m"), words(0, CABLE + 4, "cable"),
      stroke(columns.map((x) => `M${px(x)} 20V${HEIGHT - 16}`).join(""), "line"),
      ...columns.map((x) => words(px(x), HEIGHT - 3, x, 'text-anchor="middle"'))];
    ends.slice(1).forEach((end, k) => {
      const bad = broken.some((rule) => rule.stretches.some(([a, b]) => a <= ends[k] && end <= b));
      parts.push(stroke(`M${px(ends[k])} ${CABLE}H${px(end)}`, bad ? "bad" : "cable", 'stroke-width="6"'));
    });
    if (answer.state.ring) {
      parts.push(stroke(`M${px(length())} ${CABLE}V20H${px(0)}V${CABLE}`, "cable", 'stroke-width="3" stroke-dasharray="6 4"'));
    }
    cable.setAttribute("height", HEIGHT);
    base.innerHTML = parts.join("");
    const missing = state.devices.length - devices.children.length;
    for (let k = 0; k < -missing; k += 1) devices.lastChild.remove();
    for (let k = 0; k < missing; k += 1) {
      devices.insertAdjacentHTML("beforeend", '<g role="slider" tabindex="0" aria-valuemin="0"></g>');
    }
    // Devices at one place are drawn one below the other.
    const stacked = {};
    spots = state.devices.map((one) => {
      const above = stacked[write(one)] ?? 0;
      stacked[write(one)] = above + 1;
      const spur = one.kind === "slave" ? Math.min(one.spur, LONGEST) * SPUR + 5 * Math.min(above, 9) : 0;
      return [px(one.place), (LANES[one.kind] ?? CABLE) + spur];
    });
    let shown = -99;
    const order = [...spots.keys()].sort((a, b) => spots[a][0] - spots[b][0]);
    for (const k of order) {
      const [x, y] = spots[k], { kind, place, spur } = state.devices[k], nth = slaves().indexOf(k);
      const sends = nth === state.sender - 1, late = x > width - 90, unknown = Number.isNaN(answer.weakest[nth]);
      const weak = answer.weakest[nth] < limits.weakest || answer.ringing[nth] > limits.ringing || answer.volts[nth] < limits.volts;
      const bad = weak || broken.some((rule) => rule.devices.includes(k));
      let label = "";
      if (nth < 0) label = words(late ? -15 : 15, y === CABLE ? -9 : 4, name(k), late ? 'text-anchor="end"' : "");
      else if (sends || x - shown > 24) {
        label = words(0, 20, name(k).slice(6), `text-anchor="middle" ${sends ? 'font-weight="700"' : ""}`);
        shown = x;
      }
      const hollow = kind === "resistor" || unknown, fill = bad ? "bad" : hollow ? "paper" : nth < 0 ? "ink" : "first";
      const content = stroke(`M0 0V${CABLE - y}`, "pale") + '<circle r="12" fill="transparent"/>'
        + (sends ? stroke(ROUND, "second", 'stroke-width="6"') : "")
        + path(SHAPES[bad && nth >= 0 ? "failing" : kind], `fill="${color(fill)}" stroke="${color(hollow ? "ink" : "paper")}"`) + label;
      const group = devices.children[k];
      group.setAttribute("transform", `translate(${x.toFixed(1)} ${y})`);
      group.setAttribute("aria-label", name(k) + (bad ? ", violates a rule" : ""));
      group.setAttribute("aria-valuemax", length());
      group.setAttribute("aria-valuenow", place);
      group.setAttribute("aria-valuetext", `${place} m${spur ? `, spur ${spur} m` : ""}`);
      if (group.content !== content) group.innerHTML = group.content = content;
    }
    strip.innerHTML = broken.slice(0, 3).map(({ text, devices: where, stretches: [[a, b] = [0, 0]] }, row) => {
      const [x, from] = spots[where[0]] ?? [(px(a) + px(b)) / 2, CABLE], late = x > width / 2, y = STRIP + 13 * row;
      return stroke(`M${x} ${from + 9}V${y}`, "bad", 'stroke-dasharray="2 2"')
        + words(late ? x - 5 : x + 5, y, `${row + 1}. ${text.split(":")[0]}`, `fill="${color("bad")}" text-anchor="${late ? "end" : "start"}"`);
    }).join("");
  }

  function drawCharts() {
    const every = [...pins.map((pin, k) => [pin, ...PINS[k]]), [answer]], own = answer.sending, slave = `slave ${answer.labels[own]}`;
    const pen = (pin, dash, name, wide) => `stroke="${pin ?? color(name)}" stroke-dasharray="${dash ?? ""}" stroke-width="${wide}"`;
    const numbers = (key) => every.flatMap(([one]) => [...one[key]]).filter((value) => !Number.isNaN(value));
    // Values beyond a limit are crosses, but not those of pinned states.
    const dots = ([one, pin], key, shape, name, bad) => {
      const placed = one.state.devices.map(read).filter(({ kind }) => kind === "slave");
      const points = placed.map(({ place }, k) => [Math.min(place, one.state.length), one[key][k]]);
      if (pin) return [{ points, shape, look: `fill="none" stroke="${pin}"` }];
      return [{ points: points.filter(([, y]) => !bad(y)), shape, look: `fill="${color(name)}"` },
        { points: points.filter(([, y]) => bad(y)), shape: CROSS, look: pen(color("bad"), "", "", 2) }];
    };
    const least = Math.min(limits.volts, ...numbers("profile_V"));
    chart(volts, width, 78, {
      title: `Supply voltage ≥ ${limits.volts} [V]`, note: `${slave}: ${answer.volts[own].toFixed(1)} V`,
      xs: [0, length()], ys: [[25, 20, 10].find((value) => value < least) ?? 0, 31], limits: [limits.volts],
      lines: every.map(([one, pin, dash]) => ({ x: (k) => one.profile_m[k], y: one.profile_V, look: pen(pin, dash, "first", 1.5) })),
      marks: dots([answer], "volts", DOT, "first", (value) => value < limits.volts),
    });
    chart(strengths, width, 116, {
      title: `● weakest pulse ≥ ${limits.weakest} %, ■ ringing ≤ ${limits.ringing} %`,
      note: `${slave}: ${answer.weakest[own].toFixed(0)} % and ${answer.ringing[own].toFixed(0)} %`,
      xs: [0, length()], ys: [0, 100], unit: "m", limits: [limits.weakest, limits.ringing], lines: [],
      marks: every.flatMap((one) => [...dots(one, "weakest", DOT, "first", (value) => value < limits.weakest),
        ...dots(one, "ringing", SQUARE, "second", (value) => value > limits.ringing)]),
    });
    const time = (one) => (k) => one.start_us + one.step_us * k, peak = Math.max(0, ...numbers("line").map(Math.abs));
    const range = [4, 8, 16, 32].find((value) => value >= peak) ?? 64;
    chart(wave, width, 142, {
      title: `Response of ${slave} at the scope [V]`, note: answer.reading, bad: !answer.read_well,
      xs: [answer.start_us, time(answer)(answer.line.length - 1)], ys: [-range, range], unit: "µs", limits: [],
      lines: [{ x: time(answer), y: answer.line, look: pen(null, null, "pale", 1) },
        ...every.map(([one, pin, dash]) => ({ x: time(one), y: one.filtered, look: pen(pin, dash, "first", 2) }))],
      marks: [DOT, CROSS].map((shape) => ({
        shape, look: `fill="${color("second")}" stroke="${color("second")}"`,
        points: [...answer.look_us].flatMap((x, k) => (answer.filled[k] ? shape === DOT : shape === CROSS) ? [[x, answer.look_V[k]]] : []),
      })),
    });
  }

  // Changes ----------------------------------------------------------------------------------

  function choose(k) {
    const nth = slaves().indexOf(k);
    chosen = k;
    if (nth >= 0) state.sender = nth + 1;
  }
  function move(metre, spur, at) {
    const one = state.devices[chosen];
    one.place = Math.round(10 * clip(metre, 0, length())) / 10;
    if (one.kind === "slave") one.spur = Math.round(2 * clip(spur, 0, Math.max(LONGEST, one.spur))) / 2;
    drawCable();
    ask(false, undefined, at);
  }
  cable.onpointerdown = (event) => {
    const { left, top } = cable.getBoundingClientRect();
    const far = spots.map(([x, y]) => Math.hypot(event.clientX - left - x, event.clientY - top - y));
    const nearest = Math.min(...far), k = far.indexOf(nearest);
    if (nearest > 24) return;
    event.preventDefault();
    cable.setPointerCapture(event.pointerId);
    drag = { x: event.clientX, y: event.clientY, metre: Math.min(state.devices[k].place, length()), spur: state.devices[k].spur };
    choose(k);
    devices.children[k].focus({ preventScroll: true });
    draw();
  };
  cable.onpointermove = (event) => {
    if (!drag) return;
    // A small movement up or down does not change a spur.
    const down = event.clientY - drag.y, beyond = Math.sign(down) * Math.max(0, Math.abs(down) - 8);
    const across = (event.clientX - drag.x) / (width - LEFT - RIGHT) * length();
    move(drag.metre + across, drag.spur + beyond / SPUR, event.timeStamp);
  };
  cable.onpointerup = cable.onpointercancel = () => {
    if (drag) ask(true);
    drag = null;
  };
  devices.addEventListener("focusin", (event) => {
    if (drag) return;
    const before = state.sender;
    choose([...devices.children].indexOf(event.target));
    if (state.sender !== before) ask(true);
    draw();
  });
  devices.addEventListener("keydown", (event) => {
    const { place, spur } = state.devices[chosen], step = event.shiftKey ? 0.1 : 1, here = Math.min(place, length());
    const [metre, down] = { ArrowLeft: [here - step, 0], ArrowRight: [here + step, 0], ArrowUp: [place, -1], ArrowDown: [place, 1],
      PageDown: [here - 10, 0], PageUp: [here + 10, 0], Home: [0, 0], End: [length(), 0] }[event.key] ?? [];
    if (event.key === "Delete") remove.click();
    if (metre !== undefined) {
      event.preventDefault();
      move(metre, spur + down, event.timeStamp);
    }
  });
  devices.addEventListener("keyup", (event) => {
    if (/^(Arrow|Page|Home|End)/.test(event.key)) ask(true);
  });
  new ResizeObserver(() => {
    width = Math.max(240, el.clientWidth);
    if (answer) draw();
  }).observe(el);

  // Buttons ----------------------------------------------------------------------------------

  function button(text, help, act, row = bar) {
    row.insertAdjacentHTML("beforeend", `<button class="jupyter-button" title="${safe(help)}">${safe(text)}</button> `);
    row.lastElementChild.onclick = act;
    return row.lastElementChild;
  }
  function add(kind) {
    // A supply is for a segment that has none.
    const taken = [...places(kind), ...(kind === "supply" ? places("repeater") : [])];
    const stops = [0, ...taken.sort((a, b) => a - b), length()], gaps = stops.slice(1).map((stop, k) => stop - stops[k]);
    const k = gaps.lastIndexOf(Math.max(...gaps)), ends = kind === "terminator" || kind === "resistor";
    state.devices.push({ kind, place: ends ? length() : Math.round(5 * (stops[k] + stops[k + 1])) / 10, spur: 0 });
    choose(state.devices.length - 1);
    ask(true);
  }
  function arrange(texts) {
    ask(true, { devices: [...state.devices.filter(({ kind }) => kind !== "slave").map(write), ...texts], sender: 1 });
  }
  for (const [kind, [least, , label]] of Object.entries(kinds)) {
    if (least && kind !== "slave") continue;
    button(`+ ${label}`, `Add a ${label} where there is most room.`, () => add(kind)).dataset.add = kind;
  }
  const remove = button("remove", "", () => {
    state.devices.splice(chosen, 1);
    ask(true, { devices: state.devices.map(write), sender: clip(state.sender, 1, slaves().length) });
  });
  bar.insertAdjacentHTML("beforeend", `<label>slaves <input type="number" min="1" max="${kinds.slave[1]}"></label>`);
  const count = bar.querySelector("input"), many = () => clip(Math.round(count.value), 1, kinds.slave[1]);
  count.onchange = () => arrange([`${many()}*slave@${length()}`]);
  button("evenly", "Space the slaves evenly along the cable.", count.onchange);
  button("star", "Put the slaves on spurs at the end of the cable, together a tenth as long.", () => {
    arrange(Array(many()).fill(`slave@${length()}/${(length() / many() / 10).toFixed(2)}`));
  });
  button("pin", "Keep these curves, to compare them with others; at most four.", () => showPins([...pins, answer].slice(-PINS.length)));
  button("SVG", "Save the drawing and its charts as a file.", save);

  function showPins(kept) {
    pins = kept;
    pinned.replaceChildren(...pins.map((pin, k) => {
      const row = document.createElement("p"), others = pin.state.devices.filter((one) => !/^(slave|master)/.test(one));
      const text = [`${pin.state.length} m`, `${pin.labels.length} slaves`, ...others, pin.reading].join(", ");
      row.innerHTML = `<svg width="26" height="8">${path("M0 4H26", `stroke="${PINS[k][0]}" stroke-width="2" stroke-dasharray="${PINS[k][1]}"`)}
        </svg> ${safe(text)} `;
      button("back to it", "Restore this state.", () => ask(true, pin.state), row);
      button("unpin", "Remove these curves.", () => showPins(pins.filter((one) => one !== pin)), row);
      return row;
    }));
    drawCharts();
  }
  function save() {
    const style = getComputedStyle(el), svgs = [cable, volts, strengths, wave], heights = svgs.map((svg) => +svg.getAttribute("height") + 8);
    const parts = svgs.map((svg, k) => `<g transform="translate(0 ${heights.slice(0, k).reduce((a, b) => a + b, 0)})">${svg.innerHTML}</g>`);
    const whole = `<svg xmlns="${cable.namespaceURI}" width="${width}" height="${heights.reduce((a, b) => a + b)}" font-family="sans-serif"
      font-size="11" fill="${color("ink")}">${path("M0 0H9999V9999H0z", `fill="${color("paper")}"`)}${parts.join("")}</svg>`;
    // A file has no style sheet, so the colours are written out.
    const text = whole.replace(/var\((--[\w-]+)\)/g, (_, variable) => style.getPropertyValue(variable));
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([text], { type: "image/svg+xml" }));
    link.download = "shipnet_asi_bench.svg";
    link.click();
  }

  model.on("msg:custom", receive);
  ask(true, {});
  return () => model.off("msg:custom", receive);
}

export default { render };
