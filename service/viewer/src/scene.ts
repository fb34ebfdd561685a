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
  type Light,
  Mesh,
  MeshBasicMaterial,
  MeshStandardMaterial,
  PCFShadowMap,
  PerspectiveCamera,
  PMREMGenerator,
  PlaneGeometry,
  Scene,
  Spherical,
  Vector3,
  WebGLRenderer,
} from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import type { Fruit } from "./fruit";

const HOME = new Spherical(6.3, 1.24, 0.55);
const TARGET = new Vector3(0, 0.86, 0);

export class Studio {
  private readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  private readonly camera = new PerspectiveCamera(25, 1, 0.5, 40);
  private readonly controls: OrbitControls;
  private scheduled = false;
  private last = 0;

  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly fruit: Fruit,
  ) {
    this.renderer = new WebGLRenderer({ canvas, antialias: true, alpha: true, powerPreference: "high-performance" });
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.renderer.toneMapping = ACESFilmicToneMapping;
    this.renderer.toneMappingExposure = 1.08;
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = PCFShadowMap;
    this.renderer.shadowMap.autoUpdate = false; // the lights stand still: only a new shape casts another shadow
    this.scene.environment = softBoxes(this.renderer);
    this.scene.environmentIntensity = 0.62;
    this.scene.add(...lights(), table(), fruit);

    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enablePan = false;
    this.controls.enableDamping = true;
    this.controls.dampingFactor = 0.09;
    this.controls.minDistance = 2.4;
    this.controls.maxDistance = 12;
    this.controls.maxPolarAngle = Math.PI / 2 - 0.02;
    this.controls.target.copy(TARGET);
    this.controls.addEventListener("change", () => this.invalidate());
    canvas.addEventListener("keydown", (event) => this.key(event));
    canvas.addEventListener("dblclick", () => this.home());
    new ResizeObserver(() => this.resize()).observe(canvas.parentElement as Element);
    this.home();
    this.resize();
  }

  /** Back to where the camera started. */
  home(): void {
    this.place(HOME.clone());
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

  private frame(now: number): void {
    this.scheduled = false;
    const passed = Math.min(50, now - this.last || 16);
    this.last = now;
    if (this.fruit.step(passed)) this.reshaped();
    if (this.controls.update()) this.invalidate();
    this.renderer.render(this.scene, this.camera);
    this.canvas.dataset.frames = String(this.renderer.info.render.frame);
  }

  private place(where: Spherical): void {
    where.phi = Math.min(Math.max(where.phi, 0.05), this.controls.maxPolarAngle);
    where.radius = Math.min(Math.max(where.radius, this.controls.minDistance), this.controls.maxDistance);
    this.camera.position.setFromSpherical(where).add(TARGET);
    this.controls.update();
    this.invalidate();
  }

  private key(event: KeyboardEvent): void {
    const where = new Spherical().setFromVector3(this.camera.position.clone().sub(TARGET));
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
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement as HTMLElement;
    if (!width || !height) return;
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    // the fruit fills the shorter side
    this.camera.fov = width < height ? (2 * Math.atan(Math.tan((25 * Math.PI) / 360) / this.camera.aspect) * 180) / Math.PI : 25;
    this.camera.updateProjectionMatrix();
    this.invalidate();
  }
}

function lights(): Light[] {
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
  return [key, rim, bounce];
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
