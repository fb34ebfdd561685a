// What a job computed, stage by stage, as the service draws it: one GLB per stage, blended where triangles stay.

import { Box3, BufferAttribute, type BufferGeometry, DoubleSide, Group, Material, Mesh, MeshPhysicalMaterial, type Object3D, Vector3 } from "three";
import { GLTFLoader } from "three/examples/jsm/loaders/GLTFLoader.js";
import { get } from "../service/http";
import { result, type Job } from "../service/jobs";
import type { Subject } from "./studio";

const SIZE = 1.8; // what the longest side is scaled to
const loader = new GLTFLoader();

export async function meshes(data: ArrayBuffer): Promise<Object3D> {
  const { scene } = await loader.parseAsync(data, "");
  scene.updateMatrixWorld(true);
  return scene;
}

const parts = (of: Object3D): Mesh<BufferGeometry, Material>[] => {
  const found: Mesh<BufferGeometry, Material>[] = [];
  of.traverse((one) => {
    if (one instanceof Mesh) found.push(one);
  });
  return found;
};

/** A job's stages; `more` is what each is asked for besides, as colours or a cut. */
export class Film implements Subject {
  readonly object = new Group();
  readonly stages: number[];
  height = SIZE;
  private readonly frames: (Object3D | undefined)[];
  private readonly blend = new Group();
  private readonly inner = new Group();
  private reach = new Box3();
  private now = -1;

  constructor(
    readonly job: Job,
    readonly more: Record<string, string> = {},
  ) {
    this.stages = [...job.need.stages].sort((a, b) => a - b);
    this.frames = this.stages.map(() => undefined);
    this.inner.add(this.blend);
    this.object.add(this.inner);
  }

  /** The number of the stage that is nearest. */
  nearest(stage: number): number {
    return this.stages.reduce((best, one, i) => (Math.abs(one - stage) < Math.abs(this.stages[best] - stage) ? i : best), 0);
  }

  /** Fetch all stages, the one to be seen first; `told` after each. */
  async load(first: number, told: (there: number) => void, signal: AbortSignal): Promise<void> {
    const order = [first, ...this.stages.keys()].filter((i, at, all) => all.indexOf(i) === at);
    for (const [there, i] of order.entries()) {
      const query = { stage: this.stages[i], format: "glb", ...this.more };
      const data = await (await get(result(this.job, query), { signal })).arrayBuffer();
      if (signal.aborted) return;
      const frame = await meshes(data);
      for (const part of parts(frame)) dress(part);
      this.frames[i] = frame;
      frame.visible = false;
      this.reach.union(bulk(frame));
      this.inner.add(frame);
      this.fit();
      if (there === 0) this.now = -1;
      told(there + 1);
    }
  }

  /** Show a place on the stage axis; says how it is shown. */
  show(stage: number): { index: number; blended: boolean } {
    const above = this.stages.findIndex((value) => value >= stage - 1e-12);
    const high = above < 0 ? this.stages.length - 1 : above;
    const low = Math.max(0, this.stages[high] <= stage ? high : high - 1);
    const span = this.stages[high] - this.stages[low];
    const share = span > 0 ? (stage - this.stages[low]) / span : 0;
    const near = share < 0.5 ? low : high;
    const index = this.frames[near] ? near : this.frames.findIndex((frame) => frame);
    const blended = share > 1e-6 && share < 1 - 1e-6 && index === near && this.mix(low, high, share);
    for (const [i, frame] of this.frames.entries()) {
      if (!frame) continue;
      frame.visible = i === index;
      for (const [k, part] of parts(frame).entries()) part.visible = !(blended && k === 0);
    }
    this.blend.visible = blended;
    this.now = index;
    return { index, blended };
  }

  step(): boolean {
    return false;
  }

  frozen(): Object3D {
    const copy = this.object.clone(true);
    for (const part of parts(copy)) part.geometry = part.geometry.clone();
    return copy;
  }

  /** From the object's coordinates to those of the file. */
  inFile(at: Vector3): Vector3 {
    return this.inner.worldToLocal(this.object.localToWorld(at.clone()));
  }

  get shown(): number {
    return this.now;
  }

  dispose(): void {
    for (const part of parts(this.object)) {
      part.geometry.dispose();
      part.material.dispose();
    }
  }

  /** Stand on the table, the longest side as long as a fruit's. */
  private fit(): void {
    const size = this.reach.getSize(new Vector3());
    const scale = SIZE / Math.max(size.x, size.y, size.z, 1e-9);
    const middle = this.reach.getCenter(new Vector3());
    this.inner.scale.setScalar(scale);
    this.inner.position.set(-scale * middle.x, -scale * this.reach.min.y, -scale * middle.z);
    this.height = scale * size.y;
  }

  /** Blend the surface between two stages whose triangles are the same; false where they are not. */
  private mix(low: number, high: number, share: number): boolean {
    const [a, b] = [low, high].map((i) => (this.frames[i] ? parts(this.frames[i] as Object3D)[0] : undefined));
    if (!a || !b) return false;
    const [from, to] = [a.geometry, b.geometry];
    const count = from.getAttribute("position").count;
    if (count !== to.getAttribute("position").count || from.index?.count !== to.index?.count) return false;
    // cut faces are meshed anew for every stage: as many triangles need not be the same
    if (this.more.cut && !from.index?.array.every((vertex, i) => vertex === to.index?.array[i])) return false;
    let own = this.blend.children[0] as Mesh<BufferGeometry, Material> | undefined;
    if (!own || own.geometry.getAttribute("position").count !== count) {
      this.blend.clear();
      own = new Mesh(plain(from), a.material);
      own.castShadow = own.receiveShadow = true;
      own.frustumCulled = false;
      own.applyMatrix4(a.matrixWorld.clone().premultiply(this.inner.matrixWorld.clone().invert()));
      this.blend.add(own);
    }
    for (const name of Object.keys(own.geometry.attributes)) {
      const [out, p, q] = [own.geometry, from, to].map((geometry) => geometry.getAttribute(name));
      for (let i = 0; i < out.count; i++) {
        for (let k = 0; k < out.itemSize; k++) {
          const start = p.getComponent(i, k);
          out.setComponent(i, k, start + share * (q.getComponent(i, k) - start));
        }
      }
      out.needsUpdate = true;
    }
    return true;
  }
}

/** Where almost all of a frame is: a splinter that flies off does not make the rest small. */
function bulk(frame: Object3D): Box3 {
  const found: number[][] = [[], [], []];
  const at = new Vector3();
  for (const part of parts(frame)) {
    const position = part.geometry.getAttribute("position");
    const step = Math.max(1, Math.floor(position.count / 4000));
    for (let i = 0; i < position.count; i += step) {
      at.fromBufferAttribute(position, i).applyMatrix4(part.matrixWorld);
      found.forEach((values, k) => values.push(at.getComponent(k)));
    }
  }
  const ends = found.map((values) => values.sort((a, b) => a - b)).map((values) => {
    const cut = Math.floor(0.01 * values.length);
    return [values[cut] ?? 0, values[values.length - 1 - cut] ?? 0];
  });
  return new Box3(new Vector3(...ends.map(([low]) => low)), new Vector3(...ends.map(([, high]) => high)));
}

/** A geometry of floats, whatever the file stores. */
function plain(from: BufferGeometry): BufferGeometry {
  const copy = from.clone();
  for (const name of ["position", "normal", "color"]) {
    const given = from.getAttribute(name);
    if (!given) continue;
    const values = new Float32Array(given.count * given.itemSize);
    for (let i = 0; i < given.count; i++) for (let k = 0; k < given.itemSize; k++) values[i * given.itemSize + k] = given.getComponent(i, k);
    copy.setAttribute(name, new BufferAttribute(values, given.itemSize));
  }
  for (const name of Object.keys(copy.attributes)) if (!["position", "normal", "color"].includes(name)) copy.deleteAttribute(name);
  return copy;
}

function dress(part: Mesh<BufferGeometry, Material>): void {
  part.castShadow = part.receiveShadow = true;
  part.frustumCulled = false;
  if (!part.geometry.getAttribute("normal")) part.geometry.computeVertexNormals();
  const given = part.material as MeshPhysicalMaterial;
  given.side = DoubleSide; // sheets have two
  given.envMapIntensity = 0.9;
}
