// Draws the world in three dimensions: z up, metres, as the plan has them. It draws when something changed, and else rests.
import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { numbers } from "../../data/frames";
import { lastAt } from "../../data/search";
import type { WorldThing } from "../../generated/view";
import { corners, isFloor, isWall } from "../plan/things";
import type { SceneHandle, SceneModel, SceneTrack } from "./model";

const FLOOR_Z = 0.002;
const PATH_Z = 0.015;
const HALF_PATH_M = 0.022;

export function mountScene(model: SceneModel, host: HTMLElement): SceneHandle {
  return new SceneView(model, host);
}

class SceneView implements SceneHandle {
  private readonly renderer: THREE.WebGLRenderer;
  private readonly scene = new THREE.Scene();
  private readonly camera = new THREE.PerspectiveCamera(45, 1, 0.02, 500);
  private readonly controls: OrbitControls;
  private readonly ground = new THREE.Group();
  private readonly moving = new THREE.Group();
  private readonly meshes = new Map<string, THREE.Mesh>();
  private readonly robots: RobotMesh[] = [];
  private readonly tip = document.createElement("div");
  private readonly observer: ResizeObserver;
  private readonly stopWatch: () => void;
  private asked = 0;
  private follows = false;
  private last: THREE.Vector3 | undefined;
  private shown = "";

  constructor(private readonly model: SceneModel, private readonly host: HTMLElement) {
    const isSoftware = drawnInSoftware(); // each pixel counts there
    this.renderer = new THREE.WebGLRenderer({ antialias: !isSoftware, powerPreference: "low-power" });
    this.renderer.setPixelRatio(isSoftware ? 1 : Math.min(devicePixelRatio || 1, 2));
    const canvas = this.renderer.domElement;
    canvas.className = "surface";
    canvas.tabIndex = 0;
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", "The world in three dimensions with the robot and its path");
    this.tip.className = "tip-box";
    this.tip.hidden = true;
    host.append(canvas, this.tip);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.maxPolarAngle = Math.PI / 2 - 0.03;
    this.controls.addEventListener("change", () => this.ask());
    const sun = new THREE.DirectionalLight(0xffffff, 1.6);
    sun.position.set(3, -5, 9);
    this.scene.add(new THREE.HemisphereLight(0xffffff, 0x888888, 1.7), sun, this.ground, this.moving);
    canvas.addEventListener("pointermove", (event) => this.hover(event));
    canvas.addEventListener("pointerleave", () => { this.tip.hidden = true; });
    canvas.addEventListener("dblclick", () => this.whole());
    this.observer = new ResizeObserver(() => this.ask());
    this.observer.observe(canvas);
    this.whole();
    this.stopWatch = model.watch(() => this.ask());
  }

  whole(): void {
    const { x0, y0, x1, y1 } = this.model.bounds(), middle = new THREE.Vector3((x0 + x1) / 2, (y0 + y1) / 2, 0), { clientWidth, clientHeight } = this.renderer.domElement;
    // So far away that a ball around the world is seen, across and along.
    const radius = Math.max(0.5, Math.hypot(x1 - x0, y1 - y0) / 2), half = ((this.camera.fov / 2) * Math.PI) / 180, aspect = clientHeight ? clientWidth / clientHeight : 1;
    const far = (radius * 0.95) / Math.sin(Math.atan(Math.tan(half) * Math.min(1, aspect)));
    this.controls.target.copy(middle);
    this.camera.position.set(middle.x - far * 0.1, middle.y - far * 0.68, far * 0.72);
    this.controls.update();
    this.ask();
  }

  zoom(factor: number): void {
    this.camera.position.sub(this.controls.target).divideScalar(factor).add(this.controls.target);
    this.controls.update();
    this.ask();
  }

  follow(on: boolean): void {
    this.follows = on;
    this.last = undefined;
    this.ask();
  }

  dispose(): void {
    this.stopWatch();
    this.observer.disconnect();
    this.controls.dispose();
    if (this.asked) cancelAnimationFrame(this.asked);
    this.renderer.dispose();
    this.renderer.domElement.remove();
    this.tip.remove();
  }

  private ask(): void {
    this.asked ||= requestAnimationFrame(() => {
      this.asked = 0;
      this.draw();
    });
  }

  private draw(): void {
    const canvas = this.renderer.domElement, width = canvas.clientWidth, height = canvas.clientHeight;
    if (!width || !height) return;
    const size = this.renderer.getSize(new THREE.Vector2());
    if (size.x !== width || size.y !== height) {
      this.renderer.setSize(width, height, false);
      this.camera.aspect = width / height;
      this.camera.updateProjectionMatrix();
    }
    this.buildGround();
    this.placeThings();
    const tracks = this.model.tracks();
    tracks.forEach((track, n) => (this.robots[n] ??= new RobotMesh(this.scene, track, this.model)).update(track, this.model));
    this.placeContacts();
    const at = tracks[0]?.at;
    if (this.follows && at) {
      const now = new THREE.Vector3(at.x, at.y, at.z);
      if (this.last) this.camera.position.add(now.clone().sub(this.last));
      this.controls.target.copy(now);
      this.camera.lookAt(now);
      this.last = now;
    }
    this.renderer.render(this.scene, this.camera);
  }

  /** Floor and grid, anew when the bounds or the colours changed. */
  private buildGround(): void {
    const { x0, y0, x1, y1 } = this.model.bounds(), key = [x0, y0, x1, y1, this.model.colour("panel")].join(" ");
    if (key === this.shown) return;
    this.shown = key;
    this.scene.background = new THREE.Color(this.model.colour("paper"));
    empty(this.ground);
    const floor = new THREE.Mesh(new THREE.PlaneGeometry(x1 - x0, y1 - y0), new THREE.MeshLambertMaterial({ color: this.model.colour("panel") }));
    floor.position.set((x0 + x1) / 2, (y0 + y1) / 2, 0);
    this.ground.add(floor);
    const points: number[] = [];
    for (let x = Math.ceil(x0); x <= x1; x++) points.push(x, y0, FLOOR_Z, x, y1, FLOOR_Z);
    for (let y = Math.ceil(y0); y <= y1; y++) points.push(x0, y, FLOOR_Z, x1, y, FLOOR_Z);
    const grid = new THREE.BufferGeometry().setAttribute("position", new THREE.Float32BufferAttribute(points, 3));
    this.ground.add(new THREE.LineSegments(grid, new THREE.LineBasicMaterial({ color: this.model.colour("line") })));
    for (const mesh of this.meshes.values()) mesh.removeFromParent();
    this.meshes.clear();
    for (const robot of this.robots.splice(0)) robot.remove();
  }

  private placeThings(): void {
    const present = new Set<string>();
    for (const thing of this.model.things()) {
      present.add(thing.name);
      let mesh = this.meshes.get(thing.name);
      if (!mesh) {
        mesh = thingMesh(thing, this.model);
        this.meshes.set(thing.name, mesh);
        this.moving.add(mesh);
      }
      mesh.visible = true;
      mesh.position.set(thing.x_m, thing.y_m, thing.z_m + (thing.shape === "polygon" ? 0 : thickness(thing) / 2));
      mesh.rotation.z = thing.heading_rad;
    }
    for (const [name, mesh] of this.meshes) if (!present.has(name)) mesh.visible = false;
  }

  private readonly crosses = new THREE.Group();
  private placeContacts(): void {
    const contacts = this.model.contacts();
    if (this.crosses.children.length === contacts.length && this.crosses.parent) return;
    empty(this.crosses);
    this.scene.add(this.crosses);
    for (const { x, y } of contacts) {
      const post = new THREE.Mesh(new THREE.CylinderGeometry(0.025, 0.025, 0.5, 8), new THREE.MeshLambertMaterial({ color: this.model.colour("bad") }));
      post.rotation.x = Math.PI / 2;
      post.position.set(x, y, 0.25);
      this.crosses.add(post);
    }
  }

  private hover(event: PointerEvent): void {
    const canvas = this.renderer.domElement, ray = new THREE.Raycaster();
    ray.setFromCamera(new THREE.Vector2((event.offsetX / canvas.clientWidth) * 2 - 1, 1 - (event.offsetY / canvas.clientHeight) * 2), this.camera);
    const hit = ray.intersectObjects([...this.moving.children.filter((mesh) => mesh.visible), ...this.robots.map((robot) => robot.body)], true)[0];
    this.tip.hidden = !hit;
    if (!hit) return;
    this.tip.textContent = hit.object.name;
    this.tip.style.left = `${Math.min(event.offsetX + 12, this.host.clientWidth - 120)}px`;
    this.tip.style.top = `${event.offsetY + canvas.offsetTop - 24}px`;
  }
}

/** Whether the processor stands in for a graphics card. */
function drawnInSoftware(): boolean {
  const gl = document.createElement("canvas").getContext("webgl2"), info = gl?.getExtension("WEBGL_debug_renderer_info");
  const name = gl && info ? String(gl.getParameter(info.UNMASKED_RENDERER_WEBGL)) : "";
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software/i.test(name);
}

const thickness = (thing: WorldThing) => (isFloor(thing) ? Math.max(0.004, Math.min(thing.height_m, 0.02)) : Math.max(0.01, thing.height_m));

function thingMesh(thing: WorldThing, model: SceneModel): THREE.Mesh {
  const high = thickness(thing), material = new THREE.MeshLambertMaterial({ color: model.colour(isFloor(thing) ? "line" : isWall(thing) ? "wall" : "box") });
  if (isWall(thing)) Object.assign(material, { transparent: true, opacity: 0.55 });
  let shape: THREE.BufferGeometry;
  if (thing.shape === "cylinder") shape = new THREE.CylinderGeometry(thing.radius_m, thing.radius_m, high, 32).rotateX(Math.PI / 2);
  else if (thing.shape === "polygon") shape = new THREE.ExtrudeGeometry(new THREE.Shape(corners(thing).map(([x, y]) => new THREE.Vector2(x, y))), { depth: high, bevelEnabled: false });
  else shape = new THREE.BoxGeometry(thing.length_m, thing.width_m, high);
  const mesh = new THREE.Mesh(shape, material);
  mesh.name = thing.name;
  return mesh;
}

/** A robot: its hull with wheels, its path and what its range sensors see. */
class RobotMesh {
  readonly body = new THREE.Group();
  private readonly past = ribbon(1);
  private readonly future = ribbon(0.3);
  private readonly rays = new THREE.LineSegments(new THREE.BufferGeometry(), new THREE.LineBasicMaterial({ vertexColors: true, transparent: true, opacity: 0.8 }));
  private frame: unknown;

  constructor(scene: THREE.Scene, track: SceneTrack, model: SceneModel) {
    const { front_m, rear_m, width_m, height_m, name } = track.robot, long = front_m + rear_m, lift = 0.04;
    const hull = new THREE.Mesh(new THREE.BoxGeometry(long, width_m * 0.78, Math.max(0.05, height_m - lift)), new THREE.MeshLambertMaterial({ color: track.colour ?? model.colour("bad") }));
    hull.position.set((front_m - rear_m) / 2, 0, lift + (height_m - lift) / 2);
    const nose = new THREE.Mesh(new THREE.ConeGeometry(width_m * 0.16, front_m * 0.7, 3), new THREE.MeshLambertMaterial({ color: model.colour("panel") }));
    nose.rotation.z = -Math.PI / 2;
    nose.position.set(front_m * 0.55, 0, height_m + 0.012);
    nose.scale.z = 0.15;
    this.body.add(hull, nose);
    for (const side of [-1, 1]) {
      const wheel = new THREE.Mesh(new THREE.CylinderGeometry(0.08, 0.08, 0.05, 24), new THREE.MeshLambertMaterial({ color: 0x222222 }));
      wheel.position.set(0, (side * width_m) / 2 - side * 0.03, 0.08);
      this.body.add(wheel);
    }
    this.body.traverse((part) => { part.name = name || track.robot.model || "robot"; });
    for (const part of [this.past, this.future, this.rays]) part.frustumCulled = false;
    scene.add(this.body, this.past, this.future, this.rays);
  }

  update(track: SceneTrack, model: SceneModel): void {
    const { at, frame } = track, now = model.now();
    if (this.frame !== frame) {
      this.frame = frame;
      this.buildPath(track, model);
    }
    this.body.position.set(at.x, at.y, at.z);
    this.body.rotation.set(0, -at.pitch, at.heading, "ZYX");
    const row = Math.max(0, lastAt(frame.t, now));
    this.past.geometry.setDrawRange(0, 6 * row);
    this.future.geometry.setDrawRange(6 * row, Infinity);
    this.buildRays(track, model, now);
  }

  remove(): void {
    for (const part of [this.body, this.past, this.future, this.rays]) part.removeFromParent();
  }

  private buildPath({ frame, colour }: SceneTrack, model: SceneModel): void {
    const xs = numbers(frame, "x_m"), ys = numbers(frame, "y_m"), zs = numbers(frame, "z_m"), points: number[] = [], colours: number[] = [], corners: number[] = [], paint = new THREE.Color();
    let nx = 0, ny = 1; // across the way; where the robot stands, as before
    for (let n = 0; n < frame.count; n++) {
      const m = Math.min(n + 1, frame.count - 1), dx = xs[m]! - xs[Math.max(0, m - 1)]!, dy = ys[m]! - ys[Math.max(0, m - 1)]!, long = Math.hypot(dx, dy);
      if (long > 1e-6) [nx, ny] = [-dy / long, dx / long];
      paint.set(colour ?? model.scale(n / Math.max(1, frame.count - 1)));
      for (const side of [-1, 1]) {
        points.push(xs[n]! + side * HALF_PATH_M * nx, ys[n]! + side * HALF_PATH_M * ny, zs[n]! + PATH_Z);
        colours.push(paint.r, paint.g, paint.b);
      }
      if (n + 1 < frame.count) corners.push(2 * n, 2 * n + 1, 2 * n + 2, 2 * n + 2, 2 * n + 1, 2 * n + 3);
    }
    const position = new THREE.Float32BufferAttribute(points, 3), color = new THREE.Float32BufferAttribute(colours, 3);
    for (const path of [this.past, this.future]) path.geometry = new THREE.BufferGeometry().setAttribute("position", position).setAttribute("color", color).setIndex(corners);
  }

  private buildRays({ ranges, at }: SceneTrack, model: SceneModel, now: number): void {
    const points: number[] = [], colours: number[] = [], near = new THREE.Color(model.colour("bad")), far = new THREE.Color(model.colour("left"));
    const c = Math.cos(at.heading), s = Math.sin(at.heading), z = at.z + 0.2;
    for (const { channel, frame } of ranges) {
      const row = lastAt(frame.t, now), values = numbers(frame, "range_m");
      if (row < 0) continue;
      channel.sensors.forEach((sensor, n) => {
        const range = values[row * frame.width + n]!;
        if (!Number.isFinite(range) || range <= 0) return;
        const colour = range < model.nearest() ? near : far, ends = [-1, 0, 1].map((side) => {
          const angle = at.heading + sensor.bearing_rad + (side * channel.cone_rad) / 2;
          const ox = at.x + c * sensor.x_m - s * sensor.y_m, oy = at.y + s * sensor.x_m + c * sensor.y_m;
          return [ox, oy, ox + Math.cos(angle) * range, oy + Math.sin(angle) * range] as const;
        });
        for (const [ox, oy, ex, ey] of ends) points.push(ox, oy, z, ex, ey, z);
        points.push(ends[0]![2], ends[0]![3], z, ends[1]![2], ends[1]![3], z, ends[1]![2], ends[1]![3], z, ends[2]![2], ends[2]![3], z);
        for (let n = 0; n < 10; n++) colours.push(colour.r, colour.g, colour.b);
      });
    }
    this.rays.geometry.dispose();
    this.rays.geometry = new THREE.BufferGeometry().setAttribute("position", new THREE.Float32BufferAttribute(points, 3)).setAttribute("color", new THREE.Float32BufferAttribute(colours, 3));
  }
}

/** A path on the floor, as a band: lines wider than a pixel cost a software renderer ten times as much as all the rest. */
function ribbon(opacity: number): THREE.Mesh<THREE.BufferGeometry, THREE.MeshBasicMaterial> {
  return new THREE.Mesh(new THREE.BufferGeometry(), new THREE.MeshBasicMaterial({ vertexColors: true, transparent: opacity < 1, opacity, side: THREE.DoubleSide }));
}

function empty(group: THREE.Group): void {
  for (const child of [...group.children]) {
    if (child instanceof THREE.Mesh || child instanceof THREE.Line) (child.geometry as THREE.BufferGeometry).dispose();
    child.removeFromParent();
  }
}
