// SPDX-License-Identifier: Apache-2.0
// Draws with WebGL2: a sun with its shadow, a sky, the ground with a grid, bodies, the skin of
// sensors, arrows. Nothing is known here of files or frames.
const kVertex = `#version 300 es
layout(location=0) in vec3 position; layout(location=1) in vec3 normal;
uniform mat4 model, camera, sun;
out vec3 place, facing; out vec4 lit;
void main() {
  vec4 world = model * vec4(position, 1.0);
  place = world.xyz; facing = mat3(model) * normal;
  lit = sun * world; gl_Position = camera * world;
}`;
const kShade = `
uniform vec3 toSun, eye, sky, soil;
uniform highp sampler2DShadow shade;
in vec4 lit;
float sunlight(float slope) {
  vec3 at = lit.xyz / lit.w * 0.5 + 0.5;
  if (any(lessThan(at, vec3(0.0))) || any(greaterThan(at, vec3(1.0)))) return 1.0;
  float sum = 0.0, texel = 1.0 / 2048.0;
  for (int i = -2; i <= 2; ++i) for (int j = -2; j <= 2; ++j)
    sum += texture(shade, vec3(at.xy + vec2(i, j) * texel, at.z - 0.0008 - 0.003 * slope));
  return sum / 25.0;
}`;
const kBody = `#version 300 es
precision highp float;
in vec3 place, facing; out vec4 pixel;
uniform vec4 colour;
${kShade}
void main() {
  vec3 n = normalize(facing), v = normalize(eye - place), h = normalize(v + toSun);
  if (dot(n, v) < 0.0) n = -n;
  float direct = max(dot(n, toSun), 0.0);
  if (direct > 0.0) direct *= sunlight(1.0 - direct);
  vec3 around = mix(soil, sky, 0.5 + 0.5 * n.z);
  vec3 c = colour.rgb * colour.rgb;
  vec3 light = c * (0.55 * around + 0.95 * direct)
    + 0.22 * direct * pow(max(dot(n, h), 0.0), 48.0)
    + 0.10 * around * pow(1.0 - max(dot(n, v), 0.0), 4.0);
  pixel = vec4(sqrt(light), colour.a);
}`;
const kGround = `#version 300 es
precision highp float;
in vec3 place, facing; out vec4 pixel;
uniform vec3 first, second, centre, background, line; uniform float spacing, reach;
${kShade}
float lines(vec2 at, float width) {
  vec2 w = fwidth(at) * width, d = abs(fract(at - 0.5) - 0.5);
  vec2 on = 1.0 - smoothstep(w * 0.5, w * 1.5, d);
  on *= clamp(1.2 - 2.0 * fwidth(at), 0.0, 1.0);
  return max(on.x, on.y);
}
void main() {
  vec2 at = vec2(dot(place, first), dot(place, second)) / spacing;
  vec3 c = mix(background, line, 0.55 * lines(at, 1.0));
  c = mix(c, line, lines(at / 5.0, 1.3));
  c *= mix(0.62, 1.0, sunlight(0.0));
  float away = length(place - centre) / reach;
  pixel = vec4(mix(c, background, smoothstep(0.35, 1.0, away)), 1.0 - smoothstep(0.7, 1.0, away));
}`;
const kArrowVertex = `#version 300 es
layout(location=0) in vec3 position; layout(location=1) in vec3 normal;
layout(location=2) in vec3 from; layout(location=3) in vec3 along;
uniform mat4 camera; uniform float thick;
out vec3 facing;
void main() {
  float size = length(along); vec3 z = along / max(size, 1e-12);
  vec3 x = normalize(cross(abs(z.z) < 0.9 ? vec3(0, 0, 1) : vec3(1, 0, 0), z)), y = cross(z, x);
  float head = min(3.2 * thick, 0.5 * size), wide = min(thick, 0.3 * size);
  float up = position.z <= 1.0 ? position.z * (size - head) : size;
  vec3 p = from + wide * (position.x * x + position.y * y) + up * z;
  facing = normal.x * x + normal.y * y + normal.z * z;
  gl_Position = camera * vec4(p, 1.0);
}`;
const kArrow = `#version 300 es
precision highp float;
in vec3 facing; out vec4 pixel; uniform vec3 toSun; uniform vec4 colour;
void main() {
  pixel = vec4(colour.rgb * (0.65 + 0.35 * dot(normalize(facing), toSun)), colour.a);
}`;
const kSkinVertex = `#version 300 es
layout(location=0) in vec2 corner; layout(location=2) in vec3 centre; layout(location=3) in vec3 u;
layout(location=4) in vec3 v; layout(location=5) in vec4 tint;
uniform mat4 camera, model; out vec4 colour;
void main() {
  colour = tint;
  gl_Position = camera * model * vec4(centre + corner.x * u + corner.y * v, 1.0);
}`;
const kSkin = `#version 300 es
precision highp float; in vec4 colour; out vec4 pixel; void main() { pixel = colour; }`;
const kNothing = `#version 300 es
precision highp float; void main() {}`;

class Renderer {
  // Throws where the browser has no WebGL2.
  constructor(canvas) {
    const gl = canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true });
    if (!gl) throw new Error("This browser has no WebGL2, which the moving picture needs.");
    this.canvas = canvas; this.gl = gl;
    this.body = this.program(kVertex, kBody); this.ground = this.program(kVertex, kGround);
    this.depth = this.program(kVertex, kNothing); this.arrows = this.program(kArrowVertex, kArrow);
    this.skin = this.program(kSkinVertex, kSkin);
    this.makeShade();
    this.arrowSolid = this.upload(arrow());
    this.arrowData = this.instances(this.arrowSolid.array, [[2, 3], [3, 3]]);
    this.plane = this.upload({ positions: [-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0],
      normals: [0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1], indices: [0, 1, 2, 0, 2, 3] });
  }

  program(vertex, fragment) {
    const gl = this.gl, program = gl.createProgram();
    for (const [type, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(type);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS) && !gl.isContextLost())
        throw new Error(`A shader does not compile: ${gl.getShaderInfoLog(shader)}`);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS))
      throw new Error(`A program does not link: ${gl.getProgramInfoLog(program)}`);
    const at = {};
    for (let i = gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); i-- > 0;) {
      const { name } = gl.getActiveUniform(program, i);
      at[name] = gl.getUniformLocation(program, name);
    }
    return { program, at };
  }

  makeShade() {
    const gl = this.gl, size = 2048, texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.DEPTH_COMPONENT24, size, size);
    for (const [name, value] of [
      [gl.TEXTURE_MIN_FILTER, gl.LINEAR], [gl.TEXTURE_MAG_FILTER, gl.LINEAR],
      [gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE], [gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE],
      [gl.TEXTURE_COMPARE_MODE, gl.COMPARE_REF_TO_TEXTURE], [gl.TEXTURE_COMPARE_FUNC, gl.LEQUAL]])
      gl.texParameteri(gl.TEXTURE_2D, name, value);
    const target = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, target);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.TEXTURE_2D, texture, 0);
    gl.drawBuffers([gl.NONE]);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    this.shade = { texture, target, size };
  }

  buffer(values, kind = this.gl.ARRAY_BUFFER) {
    const gl = this.gl, made = gl.createBuffer();
    gl.bindBuffer(kind, made);
    gl.bufferData(kind, values, gl.STATIC_DRAW);
    return made;
  }

  upload(solid) {
    const gl = this.gl, array = gl.createVertexArray();
    gl.bindVertexArray(array);
    [solid.positions, solid.normals].forEach((values, k) => {
      this.buffer(new Float32Array(values));
      gl.enableVertexAttribArray(k);
      gl.vertexAttribPointer(k, 3, gl.FLOAT, false, 0, 0);
    });
    this.buffer(new Uint32Array(solid.indices), gl.ELEMENT_ARRAY_BUFFER);
    gl.bindVertexArray(null);
    return { array, count: solid.indices.length };
  }

  // A buffer with numbers of each copy: pairs of attribute and components.
  instances(array, attributes) {
    const gl = this.gl, data = gl.createBuffer(), stride = attributes.reduce((n, a) => n + a[1], 0);
    gl.bindVertexArray(array);
    gl.bindBuffer(gl.ARRAY_BUFFER, data);
    let offset = 0;
    for (const [attribute, components] of attributes) {
      gl.enableVertexAttribArray(attribute);
      gl.vertexAttribPointer(attribute, components, gl.FLOAT, false, 4 * stride, 4 * offset);
      gl.vertexAttribDivisor(attribute, 1);
      offset += components;
    }
    gl.bindVertexArray(null);
    return data;
  }

  makeSkin() {
    const gl = this.gl, array = gl.createVertexArray();
    gl.bindVertexArray(array);
    this.buffer(new Float32Array([-1, -1, 1, -1, -1, 1, 1, 1]));
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 2, gl.FLOAT, false, 0, 0);
    return { array, data: this.instances(array, [[2, 3], [3, 3], [4, 3], [5, 4]]) };
  }

  use({ program, at }, values) {
    const gl = this.gl;
    gl.useProgram(program);
    for (const [name, value] of Object.entries(values)) {
      if (at[name] === undefined) continue;
      if (typeof value === "number") gl.uniform1f(at[name], value);
      else if (value.length === 16) gl.uniformMatrix4fv(at[name], false, value);
      else if (value.length === 4) gl.uniform4fv(at[name], value);
      else gl.uniform3fv(at[name], value);
    }
    if (at.shade !== undefined) gl.uniform1i(at.shade, 0);
  }

  draw(solid) {
    this.gl.bindVertexArray(solid.array);
    this.gl.drawElements(this.gl.TRIANGLES, solid.count, this.gl.UNSIGNED_INT, 0);
  }

  // scene: { bodies: [{solid, model, colour}], skins: [{skin, model, data, count}], arrows: {data,
  // count, thick, colour}, grounds: [{model, first, second, centre, spacing, reach}], eye,
  // target, up, angle, radius, centre, dark }.
  render(scene) {
    const gl = this.gl, { canvas } = this;
    const aspect = canvas.width / canvas.height, away = norm(sub(scene.eye, scene.target));
    const camera = product(
      perspective(scene.angle, aspect, away / 100, away * 4 + 20 * scene.radius),
      lookAt(scene.eye, scene.target, scene.up));
    const toSun = unit([0.35, -0.5, 1.0]), far = 4 * scene.radius;
    const sun = product(orthographic(1.6 * scene.radius, 0, 2 * far),
      lookAt(add(scene.centre, scale(far, toSun)), scene.centre, [0, 1, 0.01]));
    const background = scene.dark ? [0.09, 0.11, 0.15] : [0.933, 0.945, 0.965];
    const light = { camera, sun, toSun, eye: scene.eye,
      sky: scene.dark ? [0.75, 0.8, 0.9] : [1, 1, 1], soil: [0.45, 0.43, 0.42] };
    gl.enable(gl.DEPTH_TEST); gl.disable(gl.BLEND); gl.depthMask(true);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.shade.target);
    gl.viewport(0, 0, this.shade.size, this.shade.size);
    gl.clear(gl.DEPTH_BUFFER_BIT);
    for (const body of scene.bodies.filter((b) => b.colour[3] >= 1)) {
      this.use(this.depth, { model: body.model, camera: sun, sun });
      this.draw(body.solid);
    }
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(...background, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, this.shade.texture);
    gl.enable(gl.BLEND);
    gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    for (const ground of scene.grounds) {
      this.use(this.ground, { ...light, ...ground, background,
        line: scene.dark ? [0.25, 0.29, 0.37] : [0.74, 0.78, 0.84] });
      this.draw(this.plane);
    }
    const solid = scene.bodies.filter((b) => b.colour[3] >= 1);
    const clear = scene.bodies.filter((b) => b.colour[3] < 1);
    for (const body of solid) { this.use(this.body, { ...light, ...body }); this.draw(body.solid); }
    for (const { skin, model, data, count } of scene.skins) {
      this.use(this.skin, { camera, model });
      gl.bindVertexArray(skin.array);
      gl.bindBuffer(gl.ARRAY_BUFFER, skin.data);
      gl.bufferData(gl.ARRAY_BUFFER, data, gl.DYNAMIC_DRAW);
      gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, count);
    }
    gl.depthMask(false);
    for (const body of clear) { this.use(this.body, { ...light, ...body }); this.draw(body.solid); }
    if (scene.arrows && scene.arrows.count > 0) this.drawArrows(camera, toSun, scene.arrows);
    gl.depthMask(true);
  }

  // Arrows are seen through bodies: what lies before them is forgotten.
  drawArrows(camera, toSun, { data, count, thick, colour }) {
    const gl = this.gl;
    gl.bindVertexArray(this.arrowSolid.array);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.arrowData);
    gl.bufferData(gl.ARRAY_BUFFER, data, gl.DYNAMIC_DRAW);
    gl.clear(gl.DEPTH_BUFFER_BIT);
    gl.depthMask(true);
    this.use(this.arrows, { camera, toSun, thick, colour });
    gl.drawElementsInstanced(gl.TRIANGLES, this.arrowSolid.count, gl.UNSIGNED_INT, 0, count);
  }
}
