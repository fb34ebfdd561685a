// Many shapes at once: a scene as the service sends it, each shape drawn once for all its copies, and changed in place.

import { Box3, BufferAttribute, type BufferGeometry, Group, InstancedMesh, Matrix4, Mesh, type Object3D, Vector3 } from "three";
import { GLTFLoader } from "three/examples/jsm/loaders/GLTFLoader.js";
import { copied, HOME, type Subject } from "./studio";
import { normals } from "./surface";

const SIZE = 2.7; // what the longest side is scaled to
const loader = new GLTFLoader();

/** One lattice of one kind, with the copies that are drawn of it. */
export interface Lattice {
  kind: string;
  n: number;
  /** Length of r1 in its positions. */
  r1: number;
  copies: number;
  geometry: BufferGeometry;
}

export class Crowd implements Subject {
  readonly object = new Group();
  readonly lattices: Lattice[] = [];
  height = 1;
  readonly width: number;

  static async of(data: ArrayBuffer): Promise<Crowd> {
    const { scene } = await loader.parseAsync(data, "");
    return new Crowd(scene);
  }

  private constructor(scene: Object3D) {
    scene.updateMatrixWorld(true);
    const reach = extent(scene);
    const size = reach.getSize(new Vector3());
    // a bowl is seen from above, where all of its width counts on a narrow screen
    const scale = (scene.getObjectByName("bowl") ? 0.85 * SIZE : SIZE) / Math.max(size.x, size.z, 1e-9);
    const middle = reach.getCenter(new Vector3());
    scene.scale.setScalar(scale);
    scene.position.set(-scale * middle.x, -scale * reach.min.y, -scale * middle.z);
    this.width = scale * (size.x * Math.cos(HOME.theta) + size.z * Math.sin(HOME.theta));
    this.height = Math.min(1.5, scale * size.y);
    this.object.add(scene);
    scene.traverse((one) => {
      if (!(one instanceof Mesh)) return;
      one.castShadow = one.receiveShadow = true;
      one.frustumCulled = false;
      if (one instanceof InstancedMesh) this.take(one);
    });
  }

  get copies(): number {
    return this.lattices.reduce((sum, one) => sum + one.copies, 0);
  }

  /** Give a lattice other points: rows, then poles, as the service orders them [r1]. */
  reshape(one: Lattice, points: Float32Array): void {
    const [position, normal] = ["position", "normal"].map((name) => one.geometry.getAttribute(name));
    const values = position.array as Float32Array;
    for (let k = 0; k < points.length; k++) values[k] = points[k] * one.r1;
    normals(values, one.geometry.index?.array ?? [], normal.array as Float32Array);
    position.needsUpdate = normal.needsUpdate = true;
  }

  step(): boolean {
    return false;
  }

  frozen(): Object3D {
    return copied(this.object);
  }

  dispose(): void {
    this.object.traverse((one) => {
      if (one instanceof Mesh) one.geometry.dispose();
      if (one instanceof InstancedMesh) one.dispose();
    });
  }

  /** Mirrored copies share the lattice of the others. */
  private take(mesh: InstancedMesh): void {
    const { geometry, userData } = mesh;
    const known = this.lattices.find((one) => one.geometry === geometry);
    if (known) {
      known.copies += mesh.count;
      return;
    }
    for (const name of ["position", "normal"]) {
      const given = geometry.getAttribute(name);
      const values = new Float32Array(given.count * 3);
      for (let i = 0; i < given.count; i++) for (let k = 0; k < 3; k++) values[3 * i + k] = given.getComponent(i, k);
      geometry.setAttribute(name, new BufferAttribute(values, 3));
    }
    this.lattices.push({ kind: userData.kind, n: userData.colatitudes, r1: userData.r1, copies: mesh.count, geometry });
  }
}

/** The box that holds every vertex of every copy, or what is above a bowl: those of the copies' boxes are larger. */
function extent(scene: Object3D): Box3 {
  const reach = new Box3();
  const [at, own, turn] = [new Vector3(), new Matrix4(), new Matrix4()];
  scene.traverse((one) => {
    if (!(one instanceof Mesh)) return;
    const position = one.geometry.getAttribute("position");
    const copies = one instanceof InstancedMesh ? one.count : 1;
    const step = Math.max(1, Math.floor(position.count / 600));
    for (let copy = 0; copy < copies; copy++) {
      own.copy(one.matrixWorld);
      if (one instanceof InstancedMesh) own.multiply(turn.fromArray(one.instanceMatrix.array, 16 * copy));
      for (let i = 0; i < position.count; i += step) reach.expandByPoint(at.fromBufferAttribute(position, i).applyMatrix4(own));
    }
  });
  // what rolled away from a bowl is not what is looked at
  const bowl = scene.getObjectByName("bowl");
  if (bowl instanceof Mesh) {
    const { min, max } = new Box3().setFromObject(bowl);
    for (const axis of ["x", "z"] as const) [reach.min[axis], reach.max[axis]] = [min[axis], max[axis]];
  }
  return reach;
}
