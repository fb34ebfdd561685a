// A small photo studio: soft boxes, a grazing key light that draws the relief, a table that catches the shadow.

import {
  ACESFilmicToneMapping,
  BackSide,
  BoxGeometry,
  CanvasTexture,
  CircleGeometry,
  Color,
  DirectionalLight,
  HemisphereLight,
  Mesh,
  MeshBasicMaterial,
  MeshStandardMaterial,
  type Object3D,
  PCFShadowMap,
  PerspectiveCamera,
  PlaneGeometry,
  PMREMGenerator,
  Raycaster,
  Scene,
  Spherical,
  Vector2,
  Vector3,
  WebGLRenderer,
} from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { drawsByProcessor, type Look, preferred } from "./means";
import { SkinMaterial } from "./skin";

export const HOME = new Spherical(6.3, 1.24, 0.55);
const FOV = 25;
const TARGET = new Vector3(0, 0.86, 0);

/** What can stand on the table. */
export interface Subject {
  readonly object: Object3D;
  /** How tall it is, where the fruit of radius 1 is about 1.8. */
  readonly height: number;
  /** How wide it is, as seen from home; where it is wider than tall. */
  readonly width?: number;
  /** Move on by milliseconds; true while there is more to do. */
  step(milliseconds: number): boolean;
  /** A copy that stays as it is now, to compare with. */
  frozen(): Object3D;
}

export class Studio {
  readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  private readonly camera = new PerspectiveCamera(FOV, 1, 0.5, 40);
  private readonly controls: OrbitControls;
  private readonly target = TARGET.clone();
  private readonly lamps = lights();
  /** No graphics card draws. */
  readonly byProcessor = drawsByProcessor();
  private chosen: Look = preferred(this.byProcessor);
  private subject: Subject | undefined;
  private pinned: Object3D | undefined;
  private boxes: Scene["environment"] | undefined;
  private scheduled = false;
  private last = 0;
  /** Told of a click on the shape: the ray's first hit in the coordinates of the subject's object. */
  picked: ((at: Vector3) => void) | undefined;
  /** A brush: while there is one, dragging over the shape paints instead of turning it. */
  stroke: { dab(at: Vector3): void; end(): void } | undefined;

  constructor(private readonly canvas: HTMLCanvasElement) {
    // where the processor draws, four samples a pixel would be four times the work
    const antialias = !this.byProcessor;
    this.renderer = new WebGLRenderer({ canvas, antialias, alpha: true, powerPreference: "high-performance" });
    this.renderer.toneMapping = ACESFilmicToneMapping;
    this.renderer.toneMappingExposure = 1.08;
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = PCFShadowMap;
    this.renderer.shadowMap.autoUpdate = false; // the lights stand still: only a new shape casts another shadow
    this.scene.environmentIntensity = 0.62;
    this.scene.add(...Object.values(this.lamps), table());
    this.dress();

    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enablePan = false;
    this.controls.enableDamping = true;
    this.controls.dampingFactor = 0.09;
    this.controls.minDistance = 2.4;
    this.controls.maxDistance = 12;
    this.controls.maxPolarAngle = Math.PI / 2 - 0.02;
    this.controls.addEventListener("change", () => this.invalidate());
    canvas.addEventListener("keydown", (event) => this.key(event));
    canvas.addEventListener("dblclick", () => this.home());
    listenToClicks(canvas, (x, y) => this.pick(x, y));
    this.listenToStrokes();
    new ResizeObserver(() => this.resize()).observe(canvas.parentElement as Element);
    this.home();
    this.resize();
  }

  /** Soft boxes, shadows and pores, or what can be drawn at the rate of a hand without a graphics card. */
  get look(): Look {
    return this.chosen;
  }

  set look(look: Look) {
    this.chosen = look;
    this.dress();
    this.resize();
    this.reshaped();
  }

  private dress(): void {
    const plain = this.chosen === "plain";
    const { key, bounce, fill } = this.lamps;
    if (!plain) this.boxes ??= softBoxes(this.renderer);
    this.scene.environment = plain ? null : (this.boxes ?? null);
    key.castShadow = !plain;
    // what the boxes would give comes from all around
    bounce.intensity = plain ? 1.7 : 0.75;
    fill.visible = plain;
    this.renderer.setPixelRatio(plain ? 1 : this.byProcessor ? 1.5 : Math.min(devicePixelRatio, 2));
    for (const object of [this.subject?.object, this.pinned]) if (object) simplify(object, plain);
    this.canvas.dataset.look = this.chosen;
  }

  /** Put something on the table in place of what stood there; nothing clears it. */
  stand(subject: Subject | undefined): void {
    if (this.subject) this.scene.remove(this.subject.object);
    this.subject = subject;
    if (subject) {
      simplify(subject.object, this.chosen === "plain");
      this.scene.add(subject.object);
    }
    this.resize();
    this.aim();
    this.reshaped();
  }

  /** Keep what is shown beside what comes; without anything to keep, show one alone again. */
  pin(keep: boolean): void {
    if (this.pinned) this.scene.remove(this.pinned);
    this.pinned = keep ? this.subject?.frozen() : undefined;
    if (this.pinned) {
      simplify(this.pinned, this.chosen === "plain");
      this.scene.add(this.pinned);
    }
    this.resize();
    this.reshaped();
  }

  /** Look at the middle of what stands there. */
  aim(): void {
    const height = this.subject?.height ?? 0;
    const offset = this.camera.position.clone().sub(this.target);
    this.target.y = height ? 0.48 * height : TARGET.y;
    this.camera.position.copy(this.target).add(offset);
    this.controls.target.copy(this.target);
    this.controls.update();
    this.invalidate();
  }

  /** Back to where the camera started. */
  home(): void {
    this.place(HOME.clone());
  }

  /** Go round what stands there by an angle [radian]. */
  turn(by: number): void {
    const where = new Spherical().setFromVector3(this.camera.position.clone().sub(this.target));
    where.theta += by;
    this.place(where);
  }

  /** Draw soon; the loop sleeps as long as nothing moves. */
  invalidate(): void {
    if (this.scheduled) return;
    this.scheduled = true;
    requestAnimationFrame((now) => this.frame(now));
  }

  /** The shape is another one: its shadow is, too. */
  reshaped(): void {
    this.renderer.shadowMap.needsUpdate = true;
    this.invalidate();
  }

  /** Draw something alone, as small as a stamp, into another canvas. */
  portrait(subject: Subject, into: HTMLCanvasElement): void {
    const [width, height] = [into.width, into.height];
    const [shown, kept] = [this.subject, this.pinned];
    const ratio = this.renderer.getPixelRatio();
    for (const one of [shown?.object, kept]) if (one) one.visible = false;
    simplify(subject.object, this.chosen === "plain");
    this.scene.add(subject.object);
    const camera = new PerspectiveCamera(FOV, width / height, 0.5, 40);
    const middle = new Vector3(0, 0.48 * subject.height, 0);
    camera.position.setFromSpherical(new Spherical(5.6, 1.2, 0.55)).add(middle);
    camera.lookAt(middle);
    this.renderer.setPixelRatio(1);
    this.renderer.setSize(width, height, false);
    this.renderer.shadowMap.needsUpdate = true;
    this.renderer.render(this.scene, camera);
    into.getContext("2d")?.drawImage(this.canvas, 0, 0);
    this.scene.remove(subject.object);
    for (const one of [shown?.object, kept]) if (one) one.visible = true;
    this.renderer.setPixelRatio(ratio);
    this.resize();
    this.reshaped();
  }

  private frame(now: number): void {
    this.scheduled = false;
    const passed = Math.min(50, now - this.last || 16);
    this.last = now;
    if (this.subject?.step(passed)) this.reshaped();
    if (this.controls.update()) this.invalidate();
    if (this.pinned) this.both(this.pinned, this.subject?.object);
    else this.renderer.render(this.scene, this.camera);
    this.canvas.dataset.frames = String(this.renderer.info.render.frame);
  }

  /** What was kept on the left, what changes on the right: one camera, each with its own shadow. */
  private both(left: Object3D, right: Object3D | undefined): void {
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement as HTMLElement;
    const half = Math.floor(width / 2);
    this.renderer.setScissorTest(true);
    for (const [own, other, x] of [[left, right, 0], [right, left, half]] as const) {
      if (own) own.visible = true;
      if (other) other.visible = false;
      this.renderer.setViewport(x, 0, half, height);
      this.renderer.setScissor(x, 0, half, height);
      this.renderer.shadowMap.needsUpdate = true;
      this.renderer.render(this.scene, this.camera);
    }
    for (const one of [left, right]) if (one) one.visible = true;
    this.renderer.setScissorTest(false);
    this.renderer.setViewport(0, 0, width, height);
  }

  /** Where the middle of the view meets the shape, in its object's coordinates. */
  middle(): Vector3 | undefined {
    return this.hit(0.5, 0.5);
  }

  private hit(x: number, y: number): Vector3 | undefined {
    if (!this.subject || this.pinned) return undefined;
    const ray = new Raycaster();
    ray.setFromCamera(new Vector2(2 * x - 1, 1 - 2 * y), this.camera);
    const [found] = ray.intersectObject(this.subject.object, true);
    return found && this.subject.object.worldToLocal(found.point.clone());
  }

  private pick(x: number, y: number): void {
    const at = this.picked && this.hit(x, y);
    if (at) this.picked?.(at);
  }

  private listenToStrokes(): void {
    const { canvas } = this;
    let painting = false;
    const place = (event: PointerEvent): Vector3 | undefined => {
      const box = canvas.getBoundingClientRect();
      return this.hit((event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height);
    };
    // before the controls, so that they do not begin to turn
    canvas.addEventListener(
      "pointerdown",
      (event) => {
        const at = this.stroke && place(event);
        painting = at !== undefined;
        this.controls.enabled = !painting;
        if (at) this.stroke?.dab(at);
      },
      { capture: true },
    );
    canvas.addEventListener("pointermove", (event) => {
      const at = painting ? place(event) : undefined;
      if (at) this.stroke?.dab(at);
    });
    for (const end of ["pointerup", "pointercancel", "pointerleave"]) {
      canvas.addEventListener(end, () => {
        if (painting) this.stroke?.end();
        painting = false;
        this.controls.enabled = true;
      });
    }
  }

  /** See it from an angle off the vertical [radian]. */
  rise(angle: number): void {
    const where = new Spherical().setFromVector3(this.camera.position.clone().sub(this.target));
    where.phi = angle;
    this.place(where);
  }

  private place(where: Spherical): void {
    where.phi = Math.min(Math.max(where.phi, 0.05), this.controls.maxPolarAngle);
    where.radius = Math.min(Math.max(where.radius, this.controls.minDistance), this.controls.maxDistance);
    this.controls.target.copy(this.target);
    this.camera.position.setFromSpherical(where).add(this.target);
    this.controls.update();
    this.invalidate();
  }

  private key(event: KeyboardEvent): void {
    const where = new Spherical().setFromVector3(this.camera.position.clone().sub(this.target));
    const moves: Record<string, () => void> = {
      ArrowLeft: () => (where.theta -= 0.12),
      ArrowRight: () => (where.theta += 0.12),
      ArrowUp: () => (where.phi -= 0.1),
      ArrowDown: () => (where.phi += 0.1),
      "+": () => (where.radius /= 1.12),
      "-": () => (where.radius *= 1.12),
      Home: () => where.copy(HOME),
    };
    if (!(event.key in moves) || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    moves[event.key]();
    this.place(where);
  }

  private resize(): void {
    const { clientWidth, clientHeight: height } = this.canvas.parentElement as HTMLElement;
    if (!clientWidth || !height) return;
    this.renderer.setSize(clientWidth, height, false);
    const width = this.pinned ? Math.floor(clientWidth / 2) : clientWidth;
    this.camera.aspect = width / height;
    // the fruit fills the shorter side
    const tall = Math.tan((FOV * Math.PI) / 360) / Math.min(1, this.camera.aspect);
    const wide = (this.subject?.width ?? 0) / (2 * HOME.radius * this.camera.aspect);
    this.camera.fov = (2 * Math.atan(Math.max(tall, wide)) * 180) / Math.PI;
    this.camera.updateProjectionMatrix();
    this.invalidate();
  }
}

/** Clicks that turn nothing: where they were, as shares of the canvas. */
function listenToClicks(canvas: HTMLCanvasElement, clicked: (x: number, y: number) => void): void {
  let from = [0, 0];
  canvas.addEventListener("pointerdown", (event) => (from = [event.clientX, event.clientY]));
  canvas.addEventListener("pointerup", (event) => {
    if (Math.hypot(event.clientX - from[0], event.clientY - from[1]) > 4) return;
    const box = canvas.getBoundingClientRect();
    clicked((event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height);
  });
}

/** Leave out of materials what costs most where the processor draws, or take it in again. */
function simplify(object: Object3D, plain: boolean): void {
  object.traverse((one) => {
    if (!(one instanceof Mesh)) return;
    for (const material of [one.material].flat()) if (material instanceof SkinMaterial) material.plain = plain;
  });
}

function lights(): { key: DirectionalLight; rim: DirectionalLight; bounce: HemisphereLight; fill: DirectionalLight } {
  const key = new DirectionalLight("#ffe6cb", 3.1);
  key.position.set(-3.2, 3.9, 2.2);
  key.castShadow = true;
  key.shadow.mapSize.set(2048, 2048);
  Object.assign(key.shadow.camera, { left: -2.4, right: 2.4, top: 2.4, bottom: -2.4, near: 1, far: 12 });
  key.shadow.radius = 7;
  key.shadow.bias = -0.0006;
  key.shadow.normalBias = 0.03;
  key.target.position.copy(TARGET);
  key.target.updateMatrixWorld();
  const rim = new DirectionalLight("#a9c6ff", 1.5);
  rim.position.set(3.6, 2.2, -3.2);
  // what the table throws back: without it the underside is a hole
  const bounce = new HemisphereLight("#8f9bb0", "#c09a84", 0.75);
  // stands for the soft boxes where there are none
  const fill = new DirectionalLight("#fff4e8", 0.9);
  fill.position.set(1.5, 3, 5);
  return { key, rim, bounce, fill };
}

/** A round table top that fades into the background. */
function table(): Mesh {
  const size = 256;
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = size;
  const pen = canvas.getContext("2d") as CanvasRenderingContext2D;
  const fade = pen.createRadialGradient(size / 2, size / 2, 0, size / 2, size / 2, size / 2);
  fade.addColorStop(0, "#fff");
  fade.addColorStop(0.3, "#bbb");
  fade.addColorStop(0.65, "#333");
  fade.addColorStop(1, "#000");
  pen.fillStyle = fade;
  pen.fillRect(0, 0, size, size);
  const top = new Mesh(
    new CircleGeometry(6, 64),
    new MeshStandardMaterial({
      color: "#3c3d41",
      roughness: 0.85,
      alphaMap: new CanvasTexture(canvas),
      transparent: true,
      envMapIntensity: 0.5,
      dithering: true, // a slow gradient in the dark shows its steps
    }),
  );
  top.rotation.x = -Math.PI / 2;
  top.receiveShadow = true;
  return top;
}

/** Light from all around, as a photographer builds it: a large box above, a strip at either side, dark walls. */
function softBoxes(renderer: WebGLRenderer): Scene["environment"] {
  const room = new Scene();
  const walls = new Mesh(new BoxGeometry(20, 12, 20), new MeshBasicMaterial({ color: "#1d1f23", side: BackSide }));
  walls.position.y = 3;
  room.add(walls);
  const box = (colour: string, strength: number, width: number, height: number, x: number, y: number, z: number): void => {
    const light = new Mesh(
      new PlaneGeometry(width, height),
      new MeshBasicMaterial({ color: new Color(colour).multiplyScalar(strength) }),
    );
    light.position.set(x, y, z);
    light.lookAt(0, 0.8, 0);
    room.add(light);
  };
  box("#fff1e0", 9, 6, 4, -4.5, 6.5, 3.5);
  box("#dfe9ff", 5, 2, 6, 8, 3, -2);
  box("#ffe9d6", 2.5, 3, 5, -8.5, 2, -3);
  box("#cfd8e8", 1.2, 8, 2, 1, 2.5, 9);
  const generator = new PMREMGenerator(renderer);
  const texture = generator.fromScene(room, 0.03).texture;
  generator.dispose();
  return texture;
}

/** A copy that stays as it is while the original goes on. */
export function copied(object: Object3D): Object3D {
  const copy = object.clone(true);
  copy.traverse((one) => {
    if (one instanceof Mesh) one.geometry = one.geometry.clone();
  });
  return copy;
}
