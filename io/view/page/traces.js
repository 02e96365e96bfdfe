// SPDX-License-Identifier: Apache-2.0
// Curves over an episode, a panel for each unit, with a line at the frame that is shown.
const kInks = ["#3b82d6", "#e0702f", "#2f9e68", "#b85bc2", "#c9a227", "#d84a5f", "#3aa6b5",
  "#8a7a6a"];
const kMostNamed = 8, kMostLines = 4, kLine = 15;  // names, their lines, height of one
const kWidest = "-8.88e-8";  // a value
// Negative: failed.
const kStatus = ["converged", "split", "inaccurate", "tunnelled", "damped", "overlapping"];

class TracePanel {
  constructor(group, canvas, seek) {
    Object.assign(this, { group, canvas });
    const left = 52, right = 10;
    this.margin = { left, right, top: 40, bottom: 22 };  // top grows with the lines of names
    const go = (event) => {
      const box = canvas.getBoundingClientRect();
      seek((event.clientX - box.left - left) / (box.width - left - right));
    };
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      go(event);
    });
    canvas.addEventListener("pointermove", (event) => { if (event.buttons) go(event); });
  }

  draw(episode, frame, ink, soft, line) {
    const { canvas } = this, ratio = window.devicePixelRatio || 1;
    const width = canvas.clientWidth, height = canvas.clientHeight;
    canvas.width = Math.round(width * ratio); canvas.height = Math.round(height * ratio);
    const g = canvas.getContext("2d");
    g.setTransform(ratio, 0, 0, ratio, 0, 0);
    g.clearRect(0, 0, width, height);
    const traces = episode.traces.filter((t) => t.group === this.group), { time } = episode;
    let low = Infinity, high = -Infinity;
    for (const { values } of traces)
      for (const x of values)
        if (Number.isFinite(x)) { low = Math.min(low, x); high = Math.max(high, x); }
    if (!(low <= high)) low = 0, high = 1;
    if (high - low < 1e-9 * Math.max(1, Math.abs(high))) { low -= 0.5; high += 0.5; }
    const room = 0.06 * (high - low);
    low -= room; high += room;
    const names = this.places(g, traces, width);
    const { left, right, bottom } = this.margin;
    const top = Math.max(this.margin.top, (names.at(-1)?.line ?? 0) + 13);
    const w = width - left - right, h = height - top - bottom;
    const begin = time[0], end = Math.max(time[time.length - 1], begin + 1e-9);
    const x = (t) => left + (t - begin) / (end - begin) * w;
    const y = (v) => top + (high - v) / (high - low) * h;
    g.font = "11px system-ui, sans-serif"; g.textBaseline = "middle";
    const step = roundLength((high - low) / 3), digits = Math.max(0, -Math.floor(Math.log10(step)));
    for (let v = Math.ceil(low / step) * step; v <= high; v += step) {
      g.strokeStyle = line; g.beginPath();
      g.moveTo(left, y(v)); g.lineTo(left + w, y(v)); g.stroke();
      g.fillStyle = soft; g.textAlign = "right";
      if (Math.abs(v) < 1e-6 * step) v = 0;  // not "-0.0"
      const plain = step >= 1e-3 && step < 1e4;
      g.fillText(plain ? v.toFixed(Math.min(digits, 6)) : v.toExponential(1), left - 6, y(v));
    }
    g.textAlign = "center";
    const tick = roundLength((end - begin) / 3);
    for (let t = Math.ceil(begin / tick) * tick; t <= end + 1e-9; t += tick)
      g.fillText(`${Number(t.toPrecision(6))} s`,
        Math.min(Math.max(x(t), left + 12), left + w - 12), height - bottom / 2);
    traces.forEach(({ values }, k) => {
      g.strokeStyle = kInks[k % kInks.length]; g.lineWidth = 1.6; g.beginPath();
      let on = false;
      for (let i = 0; i < values.length; ++i) {
        if (!Number.isFinite(values[i])) { on = false; continue; }
        if (on) g.lineTo(x(time[i]), y(values[i])); else g.moveTo(x(time[i]), y(values[i]));
        on = true;
      }
      g.stroke();
    });
    g.strokeStyle = ink; g.lineWidth = 1; g.beginPath();
    g.moveTo(x(time[frame]), top); g.lineTo(x(time[frame]), top + h); g.stroke();
    this.title(g, traces, frame, names, ink, soft);
  }

  // What stands for a value beside its name.
  textOf(x) {
    if (this.group === "solver status") return kStatus[x] ?? "failed";
    if (!Number.isFinite(x)) return "–";
    const size = Math.abs(x);
    return `${size > 0 && size < 1e-3 ? x.toExponential(1) : Number(x.toPrecision(3))}`;
  }

  // Where names stand. Every value has room for the widest, so that nothing moves with the frame.
  places(g, traces, width) {
    g.font = "600 12px system-ui, sans-serif";
    const places = [];
    let at = 14 + g.measureText(this.group).width, line = 12;
    g.font = "11px system-ui, sans-serif";
    for (const { name } of traces.slice(0, kMostNamed)) {
      const text = traces.length === 1 ? kWidest : `${name} ${kWidest}`;
      const long = 14 + g.measureText(text).width;
      if (at + long > width && at > 6) { line += kLine; at = 6; }
      if (line > 12 + (kMostLines - 1) * kLine) break;
      places.push({ at, line });
      at += 8 + long;
    }
    return places;
  }

  title(g, traces, frame, places, ink, soft) {
    g.textAlign = "left"; g.fillStyle = ink; g.font = "600 12px system-ui, sans-serif";
    g.fillText(this.group, 6, 11);
    g.font = "11px system-ui, sans-serif";
    places.forEach(({ at, line }, k) => {
      const { name, values } = traces[k], value = this.textOf(values[frame]);
      g.fillStyle = kInks[k % kInks.length]; g.fillRect(at, line - 5, 9, 9);
      g.fillStyle = soft;
      g.fillText(traces.length === 1 ? value : `${name} ${value}`, at + 12, line);
    });
  }
}
