// SPDX-License-Identifier: Apache-2.0
// Tactile fields: colours, the map of a sensor with its scale, and the arrows and skin in space.
// A number triple of a cell is f·axis0, f·axis1 and pressure, in newtons per point.
const kStops = [[20, 22, 60], [42, 60, 120], [30, 112, 142], [62, 162, 122], [158, 200, 88],
  [250, 236, 130]];

// Dark blue to pale yellow: lightness rises evenly, so equal steps of force look equal.
function pressureColour(x) {
  const at = 5 * Math.min(1, Math.max(0, x)), k = Math.min(4, Math.floor(at));
  return kStops[k].map((c, i) => Math.round(c + (at - k) * (kStops[k + 1][i] - c)));
}

class SensorView {
  // `episodes`: of all, so that one scale serves them.
  constructor(sensor, index, episodes, renderer) {
    // Of all fields: least and most pressure of a cell, and of the means that arrows show: the
    // longest shear and the largest force.
    Object.assign(this, { sensor, index, low: 0, high: 0, longest: 0, largest: 0 });
    for (const { fields } of episodes) {
      const { values } = fields[index], size = 3 * sensor.cells;
      for (let i = 2; i < values.length; i += 3) {
        this.low = Math.min(this.low, values[i]);
        this.high = Math.max(this.high, values[i]);
      }
      for (let from = 0; size > 0 && from < values.length; from += size) {
        const field = values.subarray(from, from + size);
        for (const cells of this.groups()) {
          this.longest = Math.max(this.longest, norm([...this.meanShear(field, cells), 0]));
          this.largest = Math.max(this.largest, norm(this.meanForce(field, cells)));
        }
      }
    }
    if (this.high <= this.low) this.high = this.low + 1e-9;
    // Half the distance to a neighbour.
    const area = sensor.rows > 1 && sensor.cols > 1 ? sensor.height * sensor.width
      : this.extent() ** 2 / 4;
    this.half = 0.5 * Math.sqrt(area / Math.max(1, sensor.cells)) || 1e-4;
    if (renderer) this.skin = renderer.makeSkin();
    this.skinData = new Float32Array(13 * sensor.cells);
  }

  extent() {
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    const { position } = this.sensor;
    for (let i = 0; i < position.length; ++i) {
      low[i % 3] = Math.min(low[i % 3], position[i]);
      high[i % 3] = Math.max(high[i % 3], position[i]);
    }
    return norm(sub(high, low));
  }

  // The triples of the newest field at a frame; null before the first.
  at(episode, frame) {
    const { at, values } = episode.fields[this.index], k = at[frame], n = 3 * this.sensor.cells;
    return k < 0 ? null : values.subarray(k * n, (k + 1) * n);
  }

  share(pressure) { return (pressure - this.low) / (this.high - this.low); }

  // Copies of a square for the renderer: centre, two half edges, colour.
  paintSkin(field) {
    const { position, axis0, axis1, press, cells, rows, cols, height, width } = this.sensor;
    const grid = rows > 1 && cols > 1 && cells === rows * cols;
    const h0 = grid ? height / (rows - 1) / 2 : this.half;
    const h1 = grid ? width / (cols - 1) / 2 : this.half;
    for (let c = 0; c < cells; ++c) {
      const colour = pressureColour(this.share(field ? field[3 * c + 2] : 0));
      for (let k = 0; k < 3; ++k) {
        const i = 3 * c + k;
        this.skinData[13 * c + k] = position[i] - 0.05 * this.half * press[i];
        this.skinData[13 * c + 3 + k] = h0 * axis0[i];
        this.skinData[13 * c + 6 + k] = h1 * axis1[i];
        this.skinData[13 * c + 9 + k] = colour[k] / 255;
      }
      // What nothing presses lets one see through.
      this.skinData[13 * c + 12] = field && field[3 * c + 2] !== 0 ? 1 : 0.35;
    }
    return this.skinData;
  }

  // Cells that share an arrow, so that one can see them apart.
  groups() {
    if (this.grouped) return this.grouped;
    const { rows, cols, cells, place } = this.sensor, most = 12, groups = new Map();
    const grid = rows > 0 && cells === rows * cols, step = Math.ceil(cells / (most * most));
    for (let c = 0; c < cells; ++c) {
      const key = grid ? `${Math.floor(place[2 * c] * Math.min(rows, most) / rows)} ${
        Math.floor(place[2 * c + 1] * Math.min(cols, most) / cols)}` : Math.floor(c / step);
      if (!groups.has(key)) groups.set(key, []);
      groups.get(key).push(c);
    }
    this.grouped = [...groups.values()];
    return this.grouped;
  }

  // The mean force on the body at some cells, body axes.
  meanForce(field, cells) {
    const { axis0, axis1, press } = this.sensor, force = [0, 0, 0];
    for (const c of cells)
      for (let k = 0; k < 3; ++k)
        force[k] += (field[3 * c] * axis0[3 * c + k] + field[3 * c + 1] * axis1[3 * c + k]
          + field[3 * c + 2] * press[3 * c + k]) / cells.length;
    return force;
  }

  // The mean shear at those of some cells that have a place in the map: down, right.
  meanShear(field, cells) {
    const { place, turn } = this.sensor;
    let down = 0, right = 0, n = 0;
    for (const c of cells) {
      if (place[2 * c] < 0) continue;
      ++n;
      down += turn[4 * c] * field[3 * c] + turn[4 * c + 1] * field[3 * c + 1];
      right += turn[4 * c + 2] * field[3 * c] + turn[4 * c + 3] * field[3 * c + 1];
    }
    return n ? [down / n, right / n] : [0, 0];
  }

  // Adds arrows to `out`: place and force on the body, world axes. `length`: of the force
  // `largest`, which all sensors of a page share.
  addArrows(field, model, length, largest, out) {
    const { position } = this.sensor;
    if (!field || largest === 0) return;
    for (const cells of this.groups()) {
      const at = [0, 0, 0], force = this.meanForce(field, cells);
      if (norm(force) < 0.02 * largest) continue;
      for (const c of cells)
        for (let k = 0; k < 3; ++k) at[k] += position[3 * c + k] / cells.length;
      out.push(...moved(model, at), ...turned(model, scale(length / largest, force)));
    }
  }

  hasMap() { return this.sensor.rows > 0; }

  // Draws the map into a 2D context of `width` × `height`, in CSS pixels.
  drawMap(g, width, height, field, episode, frame, ink, soft) {
    const { name, rows, cols, cells, place, points } = this.sensor;
    const left = 8, top = 44, bar = 86, bottom = 38;
    const tall = (this.sensor.height || 1e-3) / rows * (rows + 1), wide = this.sensor.width || tall;
    const size = Math.min((width - left - bar) / wide, (height - top - bottom) / tall);
    const w = wide * size, h = tall * size;
    g.font = "600 14px system-ui, sans-serif"; g.fillStyle = ink; g.textAlign = "left";
    g.fillText(name, left, 17);
    g.font = "12px system-ui, sans-serif"; g.fillStyle = soft;
    g.fillText("colour: pressure · arrows: shear", left, 34);
    const image = new ImageData(cols, rows), nothing = pressureColour(this.share(0));
    for (let i = 0; i < rows * cols; ++i) image.data.set([...nothing, 255], 4 * i);
    for (let c = 0; field && c < cells; ++c)
      if (place[2 * c] >= 0)
        image.data.set(pressureColour(this.share(field[3 * c + 2])),
          4 * (place[2 * c] * cols + place[2 * c + 1]));
    if (!this.small) this.small = document.createElement("canvas");
    this.small.width = cols; this.small.height = rows;
    this.small.getContext("2d").putImageData(image, 0, 0);
    g.imageSmoothingEnabled = false;
    g.drawImage(this.small, left, top, w, h);
    if (field && this.longest > 0) {
      g.strokeStyle = "#fff"; g.lineWidth = 1.3; g.beginPath();
      const reach = 0.95 * Math.max(w, h) / 12 / this.longest;
      for (const group of this.groups()) {
        let y = 0, x = 0, n = 0;
        for (const c of group) {
          if (place[2 * c] < 0) continue;
          ++n; y += place[2 * c] + 0.5; x += place[2 * c + 1] + 0.5;
        }
        const [down, right] = this.meanShear(field, group);
        const dx = right * reach, dy = down * reach, long = Math.hypot(dx, dy);
        if (long < 1) continue;
        const x0 = left + x / n / cols * w - dx / 2, y0 = top + y / n / rows * h - dy / 2;
        const ux = dx / long, uy = dy / long, head = Math.min(5, 0.45 * long);
        g.moveTo(x0, y0); g.lineTo(x0 + dx, y0 + dy);
        g.moveTo(x0 + dx - head * (ux - 0.6 * uy), y0 + dy - head * (uy + 0.6 * ux));
        g.lineTo(x0 + dx, y0 + dy);
        g.lineTo(x0 + dx - head * (ux + 0.6 * uy), y0 + dy - head * (uy - 0.6 * ux));
      }
      g.stroke();
    }
    g.strokeStyle = soft; g.lineWidth = 1; g.strokeRect(left + 0.5, top + 0.5, w, h);
    this.drawScale(g, left + w + 12, top, h, ink);
    const sums = ["normal", "shear"]
      .map((kind) => [kind, episode.traces.find((t) => t.name === `${name} ${kind}`)])
      .filter(([, trace]) => trace)
      .map(([kind, trace]) => `${kind} ${withUnit(trace.values[frame], "N")}`);
    g.textAlign = "left"; g.fillStyle = ink;
    g.fillText(field ? `${sums.join(", ")} in all` : "no field yet", left, top + h + 17);
    g.fillStyle = soft;
    const millimetres = (x) => (1e3 * x).toPrecision(3), { sensor } = this;
    g.fillText(`${millimetres(sensor.width)} × ${millimetres(sensor.height)} mm, ${points} points`,
      left, top + h + 33);
    return { width: left + w + bar, height: top + h + bottom };
  }

  drawScale(g, x, top, h, ink) {
    for (let k = 0; k < h; ++k) {
      g.fillStyle = `rgb(${pressureColour(1 - k / h)})`;
      g.fillRect(x, top + k, 12, 1.5);
    }
    g.fillStyle = ink; g.font = "11px system-ui, sans-serif"; g.textAlign = "left";
    for (let k = 0; k <= 4; ++k)
      g.fillText(withUnit(this.low + (this.high - this.low) * k / 4, "N"), x + 17,
        top + h * (1 - k / 4) + (k === 4 ? 9 : k === 0 ? 0 : 4));
  }
}
