// Interactive view of the estimated surface: drag to turn, wheel or pinch to zoom, arrow keys too.
// Plain WebGL 2 without libraries; without it the page keeps its still pictures.
"use strict";
(function () {
  const figure = document.getElementById("viewer");
  const data = JSON.parse(document.getElementById("viewer-data").textContent);
  const canvas = figure.querySelector("canvas");
  const gl = canvas.getContext("webgl2", { antialias: true, alpha: true, premultipliedAlpha: false });
  if (!gl) return;

  const VERTEX = `#version 300 es
    in vec3 position; in vec3 normal; in vec3 colour;
    uniform mat3 turn; uniform vec3 centre; uniform float scale, zoom, aspect, size, lift;
    out vec3 seen, seenNormal, tint;
    void main() {
      seen = turn * (position - centre) * scale;
      seenNormal = turn * normal;
      tint = colour;
      float depth = 3.2 - seen.z;
      gl_Position = vec4(seen.x * zoom / aspect, seen.y * zoom, (depth - 3.2 - lift) * 0.8 * depth, depth);
      gl_PointSize = size * 3.2 / depth;
    }`;
  const FRAGMENT = `#version 300 es
    precision highp float;
    in vec3 seen, seenNormal, tint;
    uniform int kind; uniform vec4 paint; uniform float size;
    out vec4 pixel;
    void main() {
      if (kind == 2) {                                   // contacts: round dots with a rim
        float r = length(gl_PointCoord - 0.5) * 2.0;
        if (r > 1.0) discard;
        pixel = vec4(r > 0.68 ? vec3(1.0) : paint.rgb, 1.0);
        return;
      }
      if (kind == 1) { pixel = paint; return; }          // lines
      vec3 flatNormal = normalize(cross(dFdx(seen), dFdy(seen)));
      vec3 n = dot(seenNormal, seenNormal) > 0.1 ? normalize(seenNormal) : flatNormal;
      if (n.z < 0.0) n = -n;
      float light = 0.42 + 0.5 * max(dot(n, normalize(vec3(-0.35, 0.55, 0.76))), 0.0) + 0.12 * n.z;
      float colourful = max(tint.r, max(tint.g, tint.b)) - min(tint.r, min(tint.g, tint.b));
      bool striped = colourful < 0.15 && mod(gl_FragCoord.x + gl_FragCoord.y, size) < 0.35 * size;
      pixel = vec4(tint * light * (striped ? 0.68 : 1.0), 1.0);   // a guess is grey: stripes tell it on grey paper
    }`;

  const program = gl.createProgram();
  for (const [type, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
    const shader = gl.createShader(type);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) return;
  gl.useProgram(program);
  const uniform = (name) => gl.getUniformLocation(program, name);
  const place = Object.fromEntries(
    ["turn", "centre", "scale", "zoom", "aspect", "size", "lift", "kind", "paint"].map((name) => [name, uniform(name)]));

  const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const floats = (text) => new Float32Array(bytes(text).buffer);

  function upload(name, values, size, type, normalized) {
    const slot = gl.getAttribLocation(program, name);
    if (slot < 0 || !values || !values.length) return;
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, values, gl.STATIC_DRAW);
    gl.enableVertexAttribArray(slot);
    gl.vertexAttribPointer(slot, size, type, normalized, 0, 0);
  }

  function shape(positions, normals, colours, faces) {
    const array = gl.createVertexArray();
    gl.bindVertexArray(array);
    upload("position", positions, 3, gl.FLOAT, false);
    upload("normal", normals, 3, gl.FLOAT, false);
    upload("colour", colours, 3, gl.UNSIGNED_BYTE, true);
    if (faces) {
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, faces, gl.STATIC_DRAW);
    }
    return { array, count: faces ? faces.length : positions.length / 3 };
  }

  const surface = shape(floats(data.vertices), floats(data.normals), bytes(data.colours),
    new Uint32Array(bytes(data.faces).buffer));
  const contacts = shape(floats(data.contacts));
  const normals = shape(floats(data.contact_normals));
  const truth = shape(floats(data.truth));
  const starts = data.contact_counts;

  let azimuth = -0.96, elevation = 0.5, zoom = 0.86, idle = true;
  const centre = data.centre, radius = data.radius_m;

  function rotation() {                                  // columns of the matrix object -> eye
    const [ca, sa, ce, se] = [Math.cos(azimuth), Math.sin(azimuth), Math.cos(elevation), Math.sin(elevation)];
    return [-sa, -se * ca, ce * ca, ca, -se * sa, ce * sa, 0, ce, se];
  }

  const choice = (name) => { const box = figure.querySelector(`[name=${name}]`); return !box || box.checked; };
  const colour = (name) => {
    const text = getComputedStyle(figure).getPropertyValue(name).trim();
    return [1, 3, 5].map((at) => parseInt(text.slice(at, at + 2), 16) / 255);
  };

  function paint(item, kind, mode, count, rgb, lift) {
    if (!count) return;
    gl.bindVertexArray(item.array);
    gl.uniform1i(place.kind, kind);
    gl.uniform1f(place.lift, lift);
    gl.uniform4f(place.paint, ...rgb, 1);
    if (kind === 0) gl.drawElements(mode, count, gl.UNSIGNED_INT, 0);
    else gl.drawArrays(mode, 0, count);
  }

  function draw() {
    const ratio = window.devicePixelRatio || 1;
    const [width, height] = [Math.round(canvas.clientWidth * ratio), Math.round(canvas.clientHeight * ratio)];
    if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.uniformMatrix3fv(place.turn, false, rotation());
    gl.uniform3fv(place.centre, centre);
    gl.uniform1f(place.scale, 1 / radius);
    gl.uniform1f(place.zoom, 3.2 * zoom);
    gl.uniform1f(place.aspect, width / height);
    gl.uniform1f(place.size, 9 * ratio);
    const slider = figure.querySelector("[name=grasp]");
    const shown = starts.length ? starts[slider ? slider.valueAsNumber - 1 : starts.length - 1] : 0;
    if (choice("surface")) paint(surface, 0, gl.TRIANGLES, surface.count, [1, 1, 1], 0);
    if (choice("truth")) paint(truth, 1, gl.LINES, truth.count, colour("--truth"), 0.004);
    if (choice("contacts")) {
      paint(normals, 1, gl.LINES, 2 * shown, colour("--contact"), 0.01);
      paint(contacts, 2, gl.POINTS, shown, colour("--contact"), 0.02);
    }
  }

  let asked = false;
  function refresh() {
    if (asked) return;
    asked = true;
    requestAnimationFrame(() => { asked = false; draw(); });
  }
  function turn(dx, dy) {
    idle = false;
    azimuth -= dx;
    elevation = Math.min(1.55, Math.max(-1.55, elevation + dy));
    refresh();
  }
  function magnify(factor) {
    idle = false;
    zoom = Math.min(5, Math.max(0.3, zoom * factor));
    refresh();
  }

  const fingers = new Map();
  canvas.addEventListener("pointerdown", (event) => {
    fingers.set(event.pointerId, event);
    canvas.setPointerCapture(event.pointerId);
  });
  for (const name of ["pointerup", "pointercancel"])
    canvas.addEventListener(name, (event) => fingers.delete(event.pointerId));
  const spread = () => {
    const [a, b] = [...fingers.values()];
    return Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY);
  };
  canvas.addEventListener("pointermove", (event) => {
    const last = fingers.get(event.pointerId);
    if (!last) return;
    const before = fingers.size === 2 ? spread() : 0;
    fingers.set(event.pointerId, event);
    if (before) magnify(spread() / before);
    else turn((event.clientX - last.clientX) * 0.01, (event.clientY - last.clientY) * 0.01);
  });
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    magnify(Math.exp(-event.deltaY * 0.0012));
  }, { passive: false });
  canvas.addEventListener("keydown", (event) => {
    const turns = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1] };
    if (turns[event.key]) { event.preventDefault(); turn(...turns[event.key]); }
    if (event.key === "+" || event.key === "-") magnify(event.key === "+" ? 1.15 : 1 / 1.15);
  });
  figure.addEventListener("input", (event) => {
    if (event.target.name === "grasp") figure.querySelector("output").textContent = event.target.value;
    refresh();
  });
  new ResizeObserver(refresh).observe(canvas);
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  dark.addEventListener("change", refresh);

  figure.classList.add("live");
  refresh();
  if (!window.matchMedia("(prefers-reduced-motion: reduce)").matches) {
    const sway = () => { if (idle) { azimuth += 0.0035; draw(); requestAnimationFrame(sway); } };
    requestAnimationFrame(sway);
  }
})();
