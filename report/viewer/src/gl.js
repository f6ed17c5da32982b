// One WebGL context draws all views: each is painted off screen and copied to the view's own 2-D
// canvas.  So 300 views need one context, scroll and print like pictures, and are drawn only when
// something has changed and only while they are on the screen.
import {
  BufferAttribute, BufferGeometry, DataTexture, IcosahedronGeometry, InstancedBufferAttribute,
  InstancedBufferGeometry, LinearFilter, Mesh, OrthographicCamera, RGBAFormat, Scene,
  ShaderMaterial, Vector3, Vector4, WebGLRenderer, Color, ColorManagement,
} from "three";
import { lookUpTable, palettes } from "./colors.js";
import { paintScale, paintAxes, paintMeasure } from "./overlay.js";

ColorManagement.enabled = false; // colours are taken and given as they are

// Parts of a joint, the same in all views: where each is drawn (moved by x, y, z; w = 0: not at all) and its
// colour, where nothing else is coloured.
export const PARTS_MOST = 24;
const parts = {
  place: { value: Array.from({ length: PARTS_MOST }, () => new Vector4(0, 0, 0, 1)) },
  hue: { value: Array.from({ length: PARTS_MOST }, () => new Vector3(0.8, 0.8, 0.8)) },
  hued: { value: 0 },
};
const PLACE = `
  uniform vec4 place[${PARTS_MOST}];
  attribute float part;
  vec4 placed(vec3 x) {
    vec4 p = place[int(part + 0.5)];
    return p.w > 0.5 ? projectionMatrix * modelViewMatrix * vec4(x + p.xyz, 1.0) : vec4(2.0, 2.0, 2.0, 1.0);
  }`;

const LIGHT = `
  float shade(vec3 n, out float glint) {
    vec3 l = normalize(vec3(0.3, 0.45, 0.85));
    float d = dot(n, l);
    glint = 0.14 * pow(max(dot(n, normalize(l + vec3(0.0, 0.0, 1.0))), 0.0), 24.0);
    return 0.36 + 0.64 * max(d, 0.0) + 0.1 * min(d, 0.0);
  }`;

const surfaceShader = {
  vertexShader: `
    attribute float value;
    varying float v;
    varying vec3 n, own;
    uniform vec3 hue[${PARTS_MOST}];
    ${PLACE}
    void main() {
      n = normalMatrix * normal;
      v = value;
      own = hue[int(part + 0.5)];
      gl_Position = placed(position);
    }`,
  fragmentShader: `
    uniform vec3 base;
    uniform vec2 range;
    uniform float coloured;
    uniform float hued; // parts in colours of their own
    uniform float veil; // 1: solid
    uniform sampler2D palette;
    varying float v;
    varying vec3 n, own;
    ${LIGHT}
    void main() {
      float glint, s = shade(normalize(n) * (gl_FrontFacing ? 1.0 : -1.0), glint);
      float t = clamp((v - range.x) / (range.y - range.x), 0.002, 0.998);
      vec3 c = coloured > 0.5 ? texture2D(palette, vec2(t, 0.5)).rgb : hued > 0.5 ? own : base;
      if (v < -1e29) c = vec3(0.62); // not counted
      gl_FragColor = vec4(min(c * s + glint, 1.0) * veil, veil);
    }`,
};

const particleShader = {
  vertexShader: `
    attribute vec3 at;
    attribute vec3 tint;
    attribute float mark; // 0 plain, 1 stepped back, 2 chosen
    uniform float radius;
    varying vec3 n, c;
    varying float m;
    ${PLACE}
    void main() {
      n = normalMatrix * normal;
      c = tint;
      m = mark;
      float r = radius * (mark > 1.5 ? 2.0 : mark > 0.5 ? 0.7 : 1.0);
      gl_Position = placed(at + r * position);
    }`,
  fragmentShader: `
    varying vec3 n, c;
    varying float m;
    ${LIGHT}
    void main() {
      vec3 u = normalize(n);
      float glint, s = shade(u, glint);
      vec3 t = m > 0.5 && m < 1.5 ? mix(c, vec3(0.55), 0.75) : c;
      t = t * s + glint;
      if (m > 1.5 && u.z < 0.62) t = u.z < 0.4 ? vec3(0.0) : vec3(1.0); // a ring on any ground
      gl_FragColor = vec4(min(t, 1.0), 1.0);
    }`,
};

let renderer = null;
const textures = {};

export function startGraphics() {
  renderer = new WebGLRenderer({ antialias: true, alpha: true, powerPreference: "high-performance" });
  renderer.autoClear = false;
  renderer.setClearColor(0, 0);
  renderer.setPixelRatio(1);
  renderer.setSize(16, 16, false);
  renderer.domElement.addEventListener("webglcontextrestored", () => invalidateAll());
  for (const [name, palette] of Object.entries(palettes)) {
    const texture = new DataTexture(lookUpTable(palette), 256, 1, RGBAFormat);
    texture.minFilter = texture.magFilter = LinearFilter;
    texture.needsUpdate = true;
    textures[name] = texture;
  }
}

const partAttribute = (part, n, Kind) => new Kind(part ?? new Float32Array(n), 1);

/** Geometry of a surface; value (may be null) is what is coloured, part (may be null) the part of each vertex. */
export function surfaceGeometry(V, F, N, value, part = null) {
  const g = new BufferGeometry();
  g.setAttribute("position", new BufferAttribute(V, 3));
  g.setAttribute("normal", new BufferAttribute(N, 3));
  g.setAttribute("value", new BufferAttribute(value ?? new Float32Array(V.length / 3), 1));
  g.setAttribute("part", partAttribute(part, V.length / 3, BufferAttribute));
  g.setIndex(new BufferAttribute(F, 1));
  return g;
}

const ball = new IcosahedronGeometry(1, 1);

export function particleGeometry(P, tint, part = null) {
  const g = new InstancedBufferGeometry();
  g.setAttribute("position", ball.getAttribute("position"));
  g.setAttribute("normal", ball.getAttribute("normal"));
  g.setAttribute("at", new InstancedBufferAttribute(P, 3));
  g.setAttribute("part", partAttribute(part, P.length / 3, InstancedBufferAttribute));
  g.setAttribute("tint", new InstancedBufferAttribute(tint, 3));
  g.setAttribute("mark", new InstancedBufferAttribute(new Float32Array(P.length / 3), 1));
  g.instanceCount = P.length / 3;
  return g;
}

// ---- where all views look from ----

export const pose = { yaw: 0.5, pitch: 0.35, zoom: 1, x: 0, y: 0 };
const home = { ...pose };
let stage = { centre: [0, 0, 0], radius: 1, hull: [], axes: null }, room = 1;
/** All shapes lie within radius of centre, and within the points of hull, from the centre on; at first
 * their longest side (angle `yaw` from x, seen from above) is seen across.  axes: where left, posterior
 * and superior are, or null. */
export function setStage(centre, radius, yaw, hull = [], axes = null) {
  stage = { centre, radius, hull, axes };
  Object.assign(home, { yaw });
  Object.assign(pose, home);
}

/** Where parts are drawn: place (x, y, z, shown a part), hue (colours as vectors) or null. */
export function setParts(place, hue) {
  let far = 0;
  place.slice(0, PARTS_MOST).forEach((p, d) => {
    parts.place.value[d].set(...p);
    far = Math.max(far, Math.hypot(p[0], p[1], p[2]));
  });
  parts.hued.value = hue ? 1 : 0;
  if (hue) hue.slice(0, PARTS_MOST).forEach((c, d) => parts.hue.value[d].set(...c));
  room = 1 + far / stage.radius;
  invalidateAll();
}
const placeOf = (part) => parts.place.value[part ?? 0];

/** Half of the height that holds all shapes in a view of that form: in the pose, and however it is turned
 * about the upright axis. */
function halfHeight(width, height, right, up) {
  let x = 0, y = 0, turned = 0;
  if (stage.hull.length === 0) return 1.04 * room * stage.radius * Math.max(1, height / width);
  for (const p of stage.hull) {
    x = Math.max(x, Math.abs(p[0] * right.x + p[1] * right.y + p[2] * right.z));
    y = Math.max(y, Math.abs(p[0] * up.x + p[1] * up.y + p[2] * up.z));
    turned = Math.max(turned, Math.hypot(p[0], p[1]));
  }
  return 1.07 * room * Math.max(y, (Math.max(x, turned) * height) / width);
}

const direction = (p) =>
  new Vector3(Math.sin(p.yaw) * Math.cos(p.pitch), -Math.cos(p.yaw) * Math.cos(p.pitch), Math.sin(p.pitch));

export function turn(change) {
  Object.assign(pose, change);
  pose.pitch = Math.min(Math.max(pose.pitch, -1.57), 1.57);
  pose.zoom = Math.min(Math.max(pose.zoom, 0.4), 20);
  invalidateAll();
}
export const resetPose = () => glide(home);

/** Turns all views until direction n points to the viewer. */
export function face(n) {
  glide({ yaw: Math.atan2(n[0], -n[1]), pitch: Math.asin(Math.min(Math.max(n[2], -1), 1)), x: 0, y: 0 });
}

function glide(to) {
  const from = { ...pose }, begin = performance.now();
  const quick = matchMedia("(prefers-reduced-motion: reduce)").matches;
  const round = 2 * Math.PI;
  const yaw = from.yaw + ((((to.yaw - from.yaw) % round) + 3 * Math.PI) % round) - Math.PI;
  const step = (now) => {
    const t = quick ? 1 : Math.min((now - begin) / 350, 1), s = t * t * (3 - 2 * t);
    const change = {};
    for (const key of Object.keys(to)) change[key] = from[key] + s * ((key === "yaw" ? yaw : to[key]) - from[key]);
    turn(change);
    if (t < 1) requestAnimationFrame(step);
  };
  requestAnimationFrame(step);
}

// ---- views ----

const views = new Set(), dirty = new Set();
let waiting = false, active = null; // the view under the pointer comes first

function paintSome() {
  waiting = false;
  const begin = performance.now();
  const ordered = dirty.has(active) ? [active, ...dirty] : [...dirty];
  for (const view of ordered) {
    if (!dirty.has(view)) continue;
    dirty.delete(view);
    view.paint();
    if (performance.now() - begin > 40 && dirty.size > 0) break; // the rest in the next frame
  }
  if (dirty.size > 0) schedule();
}
function schedule() {
  if (waiting || !renderer) return;
  waiting = true;
  requestAnimationFrame(paintSome);
}
export function invalidateAll() {
  for (const view of views) view.invalidate();
}
/** While printing, everything is painted and stays so, also what is off the screen. */
let printing = false;
export function setPrinting(on) {
  printing = on;
  for (const view of views) view.show(on || view.seen);
  while (on && dirty.size > 0) for (const view of [...dirty]) dirty.delete(view), view.paint();
}
export const idle = () => dirty.size === 0;

const seen = new IntersectionObserver(
  (entries) => entries.forEach(({ target: { view }, isIntersecting }) => {
    view.seen = isIntersecting;
    if (!printing) view.show(isIntersecting);
  }),
  { rootMargin: "120px" },
);
const resized = new ResizeObserver((entries) => entries.forEach((entry) => entry.target.view.invalidate()));

export class View {
  /** large: takes the wheel and two fingers, too. */
  constructor(canvas, { large = false, radius, pick = null }) {
    this.canvas = canvas;
    canvas.view = this;
    this.large = large;
    this.on = this.seen = false;
    this.scene = new Scene();
    this.camera = new OrthographicCamera();
    this.skin = new ShaderMaterial({
      ...surfaceShader,
      uniforms: { base: { value: new Color() }, range: { value: [0, 1] }, coloured: { value: 0 }, veil: { value: 1 }, palette: { value: null }, ...parts },
    });
    this.skin.side = 2;
    this.veil = new ShaderMaterial({
      ...surfaceShader, transparent: true, depthWrite: false, premultipliedAlpha: true,
      uniforms: { base: { value: new Color("#3b6fb6") }, range: { value: [0, 1] }, coloured: { value: 0 }, veil: { value: 0.35 }, palette: { value: null }, ...parts },
    });
    this.measured = null; // points between which is measured
    this.dots = new ShaderMaterial({ ...particleShader, uniforms: { radius: { value: radius }, place: parts.place } });
    this.pickable = null;
    this.onpick = pick;
    views.add(this);
    seen.observe(canvas);
    resized.observe(canvas);
    listen(this);
  }
  /** ghost: a second surface, seen through. */
  set({ surface, particles, ghost = null, palette = null, range = [0, 1] }) {
    this.scene.clear();
    this.surface = surface;
    if (surface) this.scene.add(new Mesh(surface, this.skin));
    if (ghost) this.scene.add(new Mesh(ghost, this.veil));
    if (particles) this.scene.add(new Mesh(particles, this.dots));
    for (const object of this.scene.children) object.frustumCulled = false;
    this.skin.uniforms.coloured.value = palette ? 1 : 0;
    this.skin.uniforms.palette.value = textures[palette ?? "heat"];
    this.skin.uniforms.range.value = range;
    this.invalidate();
  }
  /** What can be picked: places and normals of particles, and their parts. */
  setPickable(P, N, part = null) {
    this.pickable = P ? { P, N, part } : null;
  }
  show(on) {
    this.on = on;
    if (on) this.invalidate();
    else if (!this.large) this.canvas.width = 0; // gives the memory back
  }
  invalidate() {
    if (!this.on) return;
    dirty.add(this);
    schedule();
  }
  aim(width, height) {
    const c = this.camera, to = direction(pose);
    const right = new Vector3(Math.cos(pose.yaw), Math.sin(pose.yaw), 0);
    const up = new Vector3().crossVectors(to, right);
    const y = halfHeight(width, height, right, up) / pose.zoom, x = (y * width) / height;
    Object.assign(c, { left: -x, right: x, top: y, bottom: -y, near: 0, far: 8 * stage.radius });
    this.perPixel = (2 * y) / height;
    const centre = new Vector3(...stage.centre)
      .addScaledVector(right, -pose.x * stage.radius)
      .addScaledVector(up, -pose.y * stage.radius);
    c.position.copy(centre).addScaledVector(to, 4 * stage.radius);
    c.up.copy(up);
    c.lookAt(centre);
    c.updateProjectionMatrix();
    c.updateMatrixWorld();
  }
  paint() {
    const canvas = this.canvas, density = Math.min(devicePixelRatio || 1, 2);
    const width = Math.round(canvas.clientWidth * density), height = Math.round(canvas.clientHeight * density);
    if (!renderer || width === 0 || height === 0) return;
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    const all = renderer.domElement;
    if (all.width < width || all.height < height)
      renderer.setSize(Math.max(all.width, width), Math.max(all.height, height), false);
    this.skin.uniforms.base.value.set(getComputedStyle(canvas).getPropertyValue("--bone").trim());
    this.aim(width, height);
    renderer.setViewport(0, 0, width, height);
    renderer.setScissor(0, 0, width, height);
    renderer.setScissorTest(true);
    renderer.clear();
    renderer.render(this.scene, this.camera);
    const flat = canvas.getContext("2d");
    flat.clearRect(0, 0, width, height);
    flat.drawImage(all, 0, all.height - height, width, height, 0, 0, width, height);
    if (this.large) this.overlay(flat, width, height, density);
  }
  /** Scale bar, orientation and what is measured, over the picture. */
  overlay(flat, width, height, density) {
    const ink = getComputedStyle(this.canvas).getPropertyValue("--text").trim(), to = direction(pose);
    const right = new Vector3(Math.cos(pose.yaw), Math.sin(pose.yaw), 0), up = new Vector3().crossVectors(to, right);
    flat.save();
    paintScale(flat, { width, height, density, ink, perPixel: this.perPixel });
    if (stage.axes)
      paintAxes(flat, { density, ink, axes: stage.axes.map((a) => [right, up, to].map((d) => a[0] * d.x + a[1] * d.y + a[2] * d.z)) });
    if (this.measured) {
      const at = this.measured.map((p) => new Vector3(...p).add(placeOf(p.part)).project(this.camera)).map((p) => [((p.x + 1) / 2) * width, ((1 - p.y) / 2) * height]);
      paintMeasure(flat, { at, points: this.measured, density, ink, ground: getComputedStyle(this.canvas).getPropertyValue("--ground").trim() });
    }
    flat.restore();
  }
  /** The picture as a PNG, on the page's ground. */
  picture(done) {
    this.paint();
    const copy = document.createElement("canvas"), flat = copy.getContext("2d");
    Object.assign(copy, { width: this.canvas.width, height: this.canvas.height });
    flat.fillStyle = getComputedStyle(document.body).getPropertyValue("--ground").trim();
    flat.fillRect(0, 0, copy.width, copy.height);
    flat.drawImage(this.canvas, 0, 0);
    copy.toBlob(done, "image/png");
  }
  /** Where the surface is hit at a point of the canvas in CSS pixels: [x, y, z], or null. */
  surfaceAt(px, py) {
    const canvas = this.canvas;
    if (!this.surface) return null;
    this.aim(canvas.clientWidth, canvas.clientHeight);
    const from = new Vector3((2 * px) / canvas.clientWidth - 1, 1 - (2 * py) / canvas.clientHeight, -1).unproject(this.camera);
    return hit(this.surface.getAttribute("position").array, this.surface.index.array, this.surface.getAttribute("part").array, from, direction(pose).negate());
  }
  /** A click while measuring: the first or the second point; a third begins anew. */
  measure(px, py) {
    const at = this.surfaceAt(px, py);
    if (!at) return;
    this.measured = this.measured.length === 2 ? [at] : [...this.measured, at];
    this.onmeasure?.(this.measured);
    this.invalidate();
  }
  /** Index of the particle at a point of the canvas in CSS pixels, or -1. */
  particleAt(px, py) {
    const at = this.pickable, canvas = this.canvas;
    if (!at) return -1;
    this.aim(canvas.clientWidth, canvas.clientHeight);
    const to = direction(pose), p = new Vector3();
    let best = -1, least = 14 * 14;
    for (let j = 0; j < at.P.length / 3; j++) {
      if (at.N[3 * j] * to.x + at.N[3 * j + 1] * to.y + at.N[3 * j + 2] * to.z < 0.05) continue;
      const place = placeOf(at.part?.[j]);
      if (place.w < 0.5) continue;
      p.set(at.P[3 * j], at.P[3 * j + 1], at.P[3 * j + 2]).add(place).project(this.camera);
      const x = ((p.x + 1) / 2) * canvas.clientWidth - px, y = ((1 - p.y) / 2) * canvas.clientHeight - py;
      if (x * x + y * y < least) { least = x * x + y * y; best = j; }
    }
    return best;
  }
}

/** First hit of the ray from o along d (Moeller and Trumbore, 1997), where it is on the shape, with its part; or null. */
function hit(V, F, part, o, d) {
  const a = new Vector3(), u = new Vector3(), w = new Vector3(), p = new Vector3(), t = new Vector3(), q = new Vector3();
  let least = Infinity, of = 0;
  for (let f = 0; f < F.length; f += 3) {
    const place = placeOf(part[F[f]]);
    if (place.w < 0.5) continue;
    a.fromArray(V, 3 * F[f]);
    u.fromArray(V, 3 * F[f + 1]).sub(a);
    w.fromArray(V, 3 * F[f + 2]).sub(a);
    a.add(place);
    const det = u.dot(p.crossVectors(d, w));
    if (det === 0) continue;
    const x = t.subVectors(o, a).dot(p) / det;
    if (x < 0 || x > 1) continue;
    const y = d.dot(q.crossVectors(t, u)) / det, s = w.dot(q) / det;
    if (y >= 0 && x + y <= 1 && s > 0 && s < least) { least = s; of = part[F[f]]; }
  }
  const place = placeOf(of);
  return least < Infinity ? Object.assign([o.x + least * d.x - place.x, o.y + least * d.y - place.y, o.z + least * d.z - place.z], { part: of }) : null;
}

// ---- mouse, fingers, keys ----

function listen(view) {
  const canvas = view.canvas, fingers = new Map();
  let moved = 0, spread = 0;
  canvas.addEventListener("pointerenter", () => (active = view));
  canvas.addEventListener("pointerdown", (e) => {
    active = view;
    fingers.set(e.pointerId, e);
    moved = 0;
    spread = 0;
    canvas.setPointerCapture(e.pointerId);
  });
  canvas.addEventListener("pointermove", (e) => {
    if (!fingers.has(e.pointerId)) {
      if (e.pointerType === "mouse") view.onpick?.(view.particleAt(e.offsetX, e.offsetY), "hover");
      return;
    }
    const before = fingers.get(e.pointerId), dx = e.clientX - before.clientX, dy = e.clientY - before.clientY;
    fingers.set(e.pointerId, e);
    moved += Math.abs(dx) + Math.abs(dy);
    const size = Math.min(canvas.clientWidth, canvas.clientHeight);
    if (fingers.size === 2 && view.large) {
      const [a, b] = [...fingers.values()], now = Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY);
      if (spread > 0) turn({ zoom: (pose.zoom * now) / spread });
      spread = now;
    } else if (moved > 3 && e.shiftKey) {
      const f = 2.12 / (pose.zoom * size);
      turn({ x: pose.x + f * dx, y: pose.y - f * dy });
    } else if (moved > 3) {
      turn({ yaw: pose.yaw - (4 * dx) / size, pitch: pose.pitch + (4 * dy) / size });
    }
  });
  const end = (e) => {
    if (!fingers.delete(e.pointerId) || e.type !== "pointerup" || moved > 3) return;
    if (view.measured) view.measure(e.offsetX, e.offsetY);
    else
      view.onpick?.(view.particleAt(e.offsetX, e.offsetY), "click");
  };
  canvas.addEventListener("pointerup", end);
  canvas.addEventListener("pointercancel", end);
  canvas.addEventListener("pointerleave", () => view.onpick?.(-1, "hover"));
  canvas.addEventListener("dblclick", resetPose);
  canvas.addEventListener("wheel", (e) => {
    if (!view.large || !(e.ctrlKey || e.metaKey)) return; // else the page scrolls
    e.preventDefault();
    turn({ zoom: pose.zoom * Math.exp(-0.003 * e.deltaY) });
  }, { passive: false });
  canvas.addEventListener("keydown", (e) => {
    const keys = {
      ArrowLeft: () => ({ yaw: pose.yaw + 0.15 }),
      ArrowRight: () => ({ yaw: pose.yaw - 0.15 }),
      ArrowUp: () => ({ pitch: pose.pitch - 0.15 }),
      ArrowDown: () => ({ pitch: pose.pitch + 0.15 }),
      "+": () => ({ zoom: pose.zoom * 1.2 }),
      "=": () => ({ zoom: pose.zoom * 1.2 }),
      "-": () => ({ zoom: pose.zoom / 1.2 }),
    };
    if (e.key === "0") resetPose();
    else if (keys[e.key]) turn(keys[e.key]());
    else return;
    e.preventDefault();
  });
}
