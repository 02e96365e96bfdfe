// SPDX-License-Identifier: Apache-2.0
// The page: reads its data, plays frames, and answers mouse, keys and buttons. What stands behind
// "#" in the address is where it begins: #episode=2&frame=40&theme=dark&turn=30&lift=20&zoom=1.2.
const $ = (id) => document.getElementById(id);

// Puts arrays in place of {type, base64}, however deep.
function unpack(value) {
  if (Array.isArray(value)) return value.map(unpack);
  if (value === null || typeof value !== "object") return value;
  if (typeof value.base64 === "string") {
    const text = atob(value.base64), bytes = new Uint8Array(text.length);
    for (let i = 0; i < text.length; ++i) bytes[i] = text.charCodeAt(i);
    return value.type === "float32" ? new Float32Array(bytes.buffer) : new Int32Array(bytes.buffer);
  }
  return Object.fromEntries(Object.entries(value).map(([key, part]) => [key, unpack(part)]));
}

const kSpeeds = [0.05, 0.1, 0.25, 0.5, 1, 2, 4];
const kHint = "drag to turn · shift-drag to move · wheel to zoom · space to play";

class Player {
  constructor(data) {
    this.data = data;
    this.wanted = new URLSearchParams(location.hash.slice(1));
    this.number = (key, otherwise) =>
      this.wanted.has(key) ? Number(this.wanted.get(key)) : otherwise;
    this.frame = 0; this.clock = 0; this.playing = false;
    const usual = matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light";
    document.documentElement.dataset.theme = this.wanted.get("theme") ?? usual;
    this.makeSolids();
    this.makePanels();
    this.makeControls();
    this.choose(Math.min(Math.max(this.number("episode", 0), 0), data.episodes.length - 1));
    this.home();
    this.seek(this.number("frame", 0));
    new ResizeObserver(() => this.redraw()).observe($("scene"));
    document.body.dataset.ready = "yes";
  }

  makeSolids() {
    try {
      this.renderer = new Renderer($("view"));
      $("view").addEventListener("webglcontextlost",
        () => this.fail("The graphics driver stopped: load the page again."));
    } catch (error) {
      this.fail(error.message);
    }
    this.solids = this.data.shapes.map((bodies) => bodies.map((body) => {
      const solid = solidOf(body);
      return solid && { radius: solid.radius(), drawn: this.renderer?.upload(solid) };
    }));
    this.sensors = this.data.sensors.map(
      (s, k) => new SensorView(s, k, this.data.episodes, this.renderer));
    // One scale for the arrows of all sensors.
    this.largest = Math.max(0, ...this.sensors.map((s) => s.largest));
    this.endSolids = this.data.end_effectors.map((end) => this.renderer?.upload(ball(end.radius)));
  }

  fail(message) {
    $("failure").hidden = false;
    $("failure").textContent = message;
    document.body.dataset.failure = message;
  }

  makePanels() {
    const { data } = this;
    document.title = `${data.title} – Tangere`;
    $("title").textContent = data.title;
    $("source").textContent = data.source;
    $("source").title = data.source;
    const notes = [...data.notes];
    if (data.stride > 1) notes.unshift(`One frame for every ${data.stride} rows of the file.`);
    if (data.sensors.some((s) => s.rows * s.cols > 0 && s.points > s.cells))
      notes.push("Maps of many points show means over cells.");
    $("notes").textContent = notes.join(" ");
    for (const sensor of this.sensors.filter((s) => s.hasMap())) {
      const card = document.createElement("div");
      card.className = "card";
      sensor.canvas = card.appendChild(document.createElement("canvas"));
      sensor.canvas.dataset.sensor = sensor.sensor.name;
      $("maps").append(card);
    }
    this.pictures = data.pictures.map((p, k) => new PictureView(p, k, () => this.redraw()));
    for (const picture of this.pictures) {
      const card = document.createElement("div");
      card.className = "card";
      picture.canvas = card.appendChild(document.createElement("canvas"));
      picture.canvas.dataset.picture = picture.picture.name;
      $("maps").append(card);
    }
    const groups = [...new Set(data.episodes.flatMap((e) => e.traces.map((t) => t.group)))];
    this.panels = groups.map((group) => {
      const card = document.createElement("div");
      card.className = "card";
      const canvas = card.appendChild(document.createElement("canvas"));
      canvas.dataset.group = group;
      $("traces").append(card);
      return new TracePanel(group, canvas, (share) => {
        this.pause();
        this.seekTime(this.first + Math.min(1, Math.max(0, share)) * (this.last - this.first));
      });
    });
  }

  makeControls() {
    const { episodes } = this.data;
    episodes.forEach(({ label }, k) => $("episode").add(new Option(label, k)));
    $("episode-label").hidden = episodes.length < 2;
    for (const speed of kSpeeds)
      $("speed").add(new Option(`${speed} ×`, speed, speed === 1, speed === 1));
    $("episode").onchange = () => { this.choose(Number($("episode").value)); this.seek(0); };
    $("play").onclick = () => this.playing ? this.pause() : this.play();
    $("frame").oninput = () => { this.pause(); this.seek(Number($("frame").value)); };
    $("arrows").onchange = $("through").onchange = () => this.redraw();
    $("home").onclick = () => { this.home(); this.redraw(); };
    $("png").onclick = () => this.savePicture();
    $("video").onclick = () => this.recording ? this.pause() : this.record();
    $("video").hidden = !(window.MediaRecorder && HTMLCanvasElement.prototype.captureStream);
    $("theme").onclick = () => {
      const root = document.documentElement.dataset;
      root.theme = root.theme === "dark" ? "light" : "dark";
      this.redraw();
    };
    $("hint").textContent = kHint;
    addEventListener("keydown", (event) => {
      if (event.target.tagName === "SELECT") return;
      const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
      if (event.key === " ") $("play").click();
      else if (step) { this.pause(); this.seek(this.frame + step); }
      else return;
      event.preventDefault();
    });
    this.steer($("view"));
  }

  steer(view) {
    view.oncontextmenu = (event) => event.preventDefault();
    view.onpointerdown = (event) => view.setPointerCapture(event.pointerId);
    view.onpointermove = (event) => {
      if (!event.buttons) return;
      const { camera } = this, x = event.movementX, y = event.movementY;
      if (event.buttons === 1 && !event.shiftKey) {
        camera.turn -= 0.4 * x;
        camera.lift = Math.min(89, Math.max(-20, camera.lift + 0.4 * y));
      } else {
        const { eye } = this.eye(), back = unit(sub(eye, camera.target));
        const right = unit(cross([0, 0, 1], back)), up = cross(back, right);
        const size = camera.away / view.clientHeight;
        camera.target = add(camera.target, add(scale(-size * x, right), scale(size * y, up)));
      }
      this.redraw();
    };
    view.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.camera.away *= Math.exp(0.001 * event.deltaY);
      this.redraw();
    }, { passive: false });
  }

  choose(k) {
    this.episode = this.data.episodes[k];
    $("episode").value = k;
    $("frame").max = this.episode.time.length - 1;
    this.first = this.episode.time[0];
    this.last = this.episode.time[this.episode.time.length - 1];
    document.body.dataset.frames = this.episode.time.length;
  }

  // A ball around all places of all bodies in the first frame, and the camera that sees it.
  home() {
    const { poses, shapes } = this.episode, bodies = this.data.shapes[shapes];
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    const frames = this.episode.time.length;
    for (const frame of [0, frames >> 1, frames - 1])
      bodies.forEach((body, b) => {
        const reach = this.solids[shapes][b]?.radius, at = 7 * (frame * bodies.length + b);
        for (let k = 0; reach && k < 3; ++k) {
          low[k] = Math.min(low[k], poses[at + k] - reach);
          high[k] = Math.max(high[k], poses[at + k] + reach);
        }
      });
    if (!(low[0] <= high[0])) { low.fill(-0.1); high.fill(0.1); }
    this.centre = scale(0.5, add(low, high));
    this.radius = Math.max(norm(sub(high, low)) / 2, 1e-4);
    this.camera = { target: this.centre,
      turn: this.number("turn", 35), lift: this.number("lift", 18),
      away: 0.85 * this.radius / Math.tan(0.32) / this.number("zoom", 1) };
  }

  eye() {
    const { turn, lift, away, target } = this.camera;
    const a = turn * Math.PI / 180, b = lift * Math.PI / 180;
    const back = [Math.sin(a) * Math.cos(b), -Math.cos(a) * Math.cos(b), Math.sin(b)];
    return { eye: add(target, scale(away, back)), target, up: [0, 0, 1], angle: 0.64 };
  }

  seek(frame) {
    this.frame = Math.min(Math.max(Math.round(frame) || 0, 0), this.episode.time.length - 1);
    this.clock = this.episode.time[this.frame];
    this.redraw();
  }

  // The newest frame at a time.
  seekTime(time) {
    const times = this.episode.time;
    let low = 0, high = times.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (times[middle] <= time + 1e-9) low = middle; else high = middle - 1;
    }
    this.frame = low;
    this.clock = time;
    this.redraw();
  }

  play() {
    if (this.frame >= this.episode.time.length - 1) this.seek(0);
    this.playing = true;
    cancelAnimationFrame(this.pending);  // one loop at a time
    $("play").textContent = "Pause";
    let before = null;
    const step = (now) => {
      if (!this.playing) return;
      if (before !== null) this.clock += (now - before) / 1000 * Number($("speed").value);
      before = now;
      this.seekTime(this.clock);
      if (this.clock >= this.last) this.pause();
      else this.pending = requestAnimationFrame(step);
    };
    this.pending = requestAnimationFrame(step);
  }

  pause() {
    this.playing = false;
    $("play").textContent = "Play";
    if (this.recording?.state === "recording") this.recording.stop();
  }

  // A half-space as the renderer wants it.
  groundOf(position, normal) {
    const reach = 9 * this.radius, n = unit(normal);
    const [first, second] = Math.abs(n[2]) > 0.999 ? [[1, 0, 0], [0, 1, 0]] : across(n);
    const foot = sub(this.centre, scale(dot(n, sub(this.centre, position)), n));
    const model = new Float32Array(
      [...scale(reach, first), 0, ...scale(reach, second), 0, ...n, 0, ...foot, 1]);
    return { model, first, second, centre: foot, spacing: roundLength(this.radius / 3), reach };
  }

  // Gives a canvas as many pixels as a size [CSS pixels] has on this screen.
  fit(canvas, width, height) {
    const ratio = window.devicePixelRatio || 1;
    const pixels = (size) => Math.max(1, Math.round(size * ratio));
    if (canvas.width === pixels(width) && canvas.height === pixels(height)) return;
    canvas.width = pixels(width); canvas.height = pixels(height);
  }

  drawScene() {
    const { renderer, episode, frame } = this;
    this.fit($("view"), $("view").clientWidth, $("view").clientHeight);
    const shapes = this.data.shapes[episode.shapes];
    const pads = new Set(this.data.sensors.map((s) => s.body));
    const models = shapes.map((_, b) => poseMatrix(episode.poses, 7 * (frame * shapes.length + b)));
    const bodies = [], { ground } = this.data;
    const grounds = ground ? [this.groundOf(ground.position, ground.normal)] : [];
    shapes.forEach(({ rgba }, b) => {
      const solid = this.solids[episode.shapes][b];
      if (shapes[b].kind === "plane") {
        grounds.push(this.groundOf(moved(models[b], [0, 0, 0]), turned(models[b], [0, 0, 1])));
        return;
      }
      const clear = $("through").checked && pads.has(b);
      bodies.push({ solid: solid.drawn, model: models[b],
        colour: [...rgba.slice(0, 3), clear ? 0.35 : rgba[3]] });
    });
    this.data.end_effectors.forEach(({ rgba }, k) => {
      const at = 3 * (frame * this.data.end_effectors.length + k);
      const p = episode.end_effectors.subarray(at, at + 3);
      bodies.push({ solid: this.endSolids[k], colour: rgba,
        model: new Float32Array([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, ...p, 1]) });
    });
    const arrows = [], skins = [];
    for (const sensor of this.sensors) {
      const field = sensor.at(episode, frame), model = models[sensor.sensor.body];
      skins.push({ skin: sensor.skin, model, data: sensor.paintSkin(field),
        count: sensor.sensor.cells });
      if ($("arrows").checked)
        sensor.addArrows(field, model, 0.45 * this.radius, this.largest, arrows);
    }
    const dark = document.documentElement.dataset.theme === "dark";
    const { radius, centre } = this;
    renderer.render({ ...this.eye(), bodies, skins, grounds, dark, radius, centre,
      arrows: { data: new Float32Array(arrows), count: arrows.length / 6, thick: 0.008 * radius,
        colour: dark ? [1, 0.45, 0.35, 1] : [0.86, 0.18, 0.12, 1] } });
    document.body.dataset.arrows = arrows.length / 6;
    $("clock").textContent = `t = ${episode.time[frame].toFixed(3)} s`;
    const parts = [];
    if (grounds.length > 0) parts.push(`grid ${withUnit(grounds[0].spacing, "m")}`);
    if (this.largest > 0 && $("arrows").checked)
      parts.push(`longest arrow ${withUnit(this.largest, "N")} per point`);
    this.legend = parts.join(" · ");
    $("hint").textContent = [this.legend, kHint].filter((part) => part).join(" — ");
  }

  inks() {
    const style = getComputedStyle(document.documentElement);
    return ["--ink", "--soft", "--line", "--panel"]
      .map((name) => style.getPropertyValue(name).trim());
  }

  redraw() {
    if (!this.camera) return;
    const { episode, frame } = this, [ink, soft, line] = this.inks();
    $("frame").value = frame;
    const seconds = (time) => time.toFixed(3);
    $("time").textContent =
      `row ${episode.rows[frame]} · ${seconds(episode.time[frame])} of ${seconds(this.last)} s`;
    document.body.dataset.frame = frame;
    if (this.renderer && !document.body.dataset.failure) this.drawScene();
    const ratio = window.devicePixelRatio || 1, maps = this.sensors.filter((s) => s.canvas);
    const room = $("scene").clientHeight / Math.max(1, Math.min(maps.length, 2)) - 30;
    for (const sensor of maps) {
      const { canvas } = sensor, width = Math.min(360, Math.max(240, room + 20));
      const height = Math.min(360, Math.max(190, room));
      this.fit(canvas, width, height);
      canvas.style.width = `${width}px`; canvas.style.height = `${height}px`;
      const g = canvas.getContext("2d");
      g.setTransform(ratio, 0, 0, ratio, 0, 0);
      g.clearRect(0, 0, width, height);
      sensor.drawMap(g, width, height, sensor.at(episode, frame), episode, frame, ink, soft);
    }
    this.drawPictures(ink);
    for (const panel of this.panels) panel.draw(episode, frame, ink, soft, line);
    if (this.stage) this.compose();
  }

  drawPictures(ink) {
    const ratio = window.devicePixelRatio || 1;
    for (const picture of this.pictures) {
      const { canvas } = picture, width = 260, height = picture.height(width) + 20;
      this.fit(canvas, width, height);
      canvas.style.width = `${width}px`; canvas.style.height = `${height}px`;
      const g = canvas.getContext("2d");
      g.setTransform(ratio, 0, 0, ratio, 0, 0);
      // While a picture is decoded, the one before stays; before the first there is none.
      if (picture.at(this.episode, this.frame) || !picture.isTaken(this.episode, this.frame))
        g.clearRect(0, 0, width, height);
      picture.draw(g, width, height, this.episode, this.frame, ink);
    }
  }

  // The scene, the maps, the pictures and the curves in one picture, for files.
  compose() {
    const [ink, soft, , panel] = this.inks(), view = $("view");
    const ratio = window.devicePixelRatio || 1, room = (size) => size > 0 ? size + gap : 0;
    const side = [...this.sensors.filter((s) => s.canvas), ...this.pictures]
      .map((s) => s.canvas);
    const low = this.panels.map((p) => p.canvas), gap = Math.round(10 * ratio);
    const wide = room(Math.max(0, ...side.map((c) => c.width)));
    const tall = room(Math.max(0, ...low.map((c) => c.height)));
    const width = 2 * Math.ceil((view.width + wide) / 2);  // videos want even numbers
    const height = 2 * Math.ceil((view.height + tall) / 2);
    const stage = this.stage ?? document.createElement("canvas");
    if (stage.width !== width || stage.height !== height) {
      stage.width = width; stage.height = height;
    }
    const g = stage.getContext("2d");
    g.fillStyle = panel; g.fillRect(0, 0, width, height);
    g.drawImage(view, 0, 0);
    let y = 0;
    for (const canvas of side) {
      g.drawImage(canvas, view.width + gap, y);
      y += canvas.height + gap;
    }
    const each = low.length ? width / low.length : 0;
    low.forEach((canvas, k) => g.drawImage(
      canvas, k * each, view.height + gap, Math.min(each, canvas.width), canvas.height));
    g.textBaseline = "alphabetic"; g.textAlign = "left";
    g.font = `600 ${16 * ratio}px system-ui, sans-serif`; g.fillStyle = ink;
    const title = `${this.data.title}, ${this.episode.label}, ${$("clock").textContent}`;
    g.fillText(title, 14 * ratio, 26 * ratio);
    g.font = `${12 * ratio}px system-ui, sans-serif`; g.fillStyle = soft;
    g.fillText(this.legend ?? "", 14 * ratio, view.height - 12 * ratio);
    return stage;
  }

  save(blob, ending) {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(blob);
    const name = `${this.data.title || "tangere"}-${this.episode.label}-${this.frame}.${ending}`;
    link.download = name.replaceAll(" ", "-");
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  }

  savePicture() { this.compose().toBlob((blob) => this.save(blob, "png")); }

  // Plays once and saves what was seen.
  record() {
    this.stage = document.createElement("canvas");
    this.seek(0);
    const type = ["video/webm;codecs=vp9", "video/webm", "video/mp4"]
      .find((t) => MediaRecorder.isTypeSupported(t));
    const recorder = new MediaRecorder(this.stage.captureStream(30),
      { mimeType: type, videoBitsPerSecond: 8e6 });
    const parts = [];
    recorder.ondataavailable = (event) => parts.push(event.data);
    recorder.onstop = () => {
      this.recording = this.stage = undefined;
      $("video").textContent = "Video";
      this.save(new Blob(parts, { type }), type.startsWith("video/mp4") ? "mp4" : "webm");
    };
    this.recording = recorder;
    $("video").textContent = "Stop";
    recorder.start();
    this.play();
  }
}

try {
  new Player(unpack(JSON.parse($("tangere-data").textContent)));
} catch (error) {
  $("failure").hidden = false;
  $("failure").textContent = `This page cannot be shown: ${error.message}`;
  document.body.dataset.failure = error.message;
}
