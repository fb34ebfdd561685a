// The shape as three.js draws it: topology built once per resolution, positions eased from one answer to the next.

import { BufferAttribute, BufferGeometry, Mesh } from "three";
import type { Skin } from "./looks";
import { SkinMaterial } from "./skin";
import type { Subject } from "./studio";
import { normals, relief, triangles, vertexCount } from "./surface";

const REACH = 0.5; // [radian] what counts as the surroundings of a wrinkle
const EASE = 45; // [ms] after which a third of the way to a new shape is left

export class Fruit extends Mesh<BufferGeometry, SkinMaterial> implements Subject {
  readonly object = this;
  readonly height = 1.8;
  private n = 0;
  private target: Float32Array = new Float32Array(0);
  private moving = false;
  private skin: Skin | undefined;
  private dryness = 0;
  private depth = 0.05;

  constructor() {
    super(new BufferGeometry(), new SkinMaterial());
    this.castShadow = this.receiveShadow = true;
    this.frustumCulled = false;
    this.visible = false; // drawn without normals once, its material would stay faceted
  }

  /** Show these points. Of the same resolution they are eased in; the last step is exactly what was given. */
  show(points: Float32Array, n: number, ease: boolean): void {
    const same = n === this.n;
    if (!same) this.build(n);
    this.target = points;
    this.visible = true;
    if (same && ease) {
      this.moving = true;
    } else {
      this.array("position").set(points);
      this.moving = false;
      this.shape();
    }
  }

  /** Move on by `milliseconds`; true while there is more to do. */
  step(milliseconds: number): boolean {
    if (!this.moving) return false;
    const position = this.array("position");
    const part = 1 - Math.exp(-milliseconds / EASE);
    let furthest = 0;
    for (let k = 0; k < position.length; k++) {
      const left = this.target[k] - position[k];
      furthest = Math.max(furthest, Math.abs(left));
      position[k] += part * left;
    }
    if (furthest < 5e-4) {
      position.set(this.target);
      this.moving = false;
    }
    this.shape();
    return true;
  }

  frozen(): Fruit {
    const copy = new Fruit();
    if (this.skin) copy.wear(this.skin, this.dryness);
    if (this.n) copy.show(this.target.slice(), this.n, false);
    return copy;
  }

  wear(skin: Skin, dryness: number): void {
    this.skin = skin;
    this.dryness = dryness;
    this.material.wear(skin, dryness, this.depth);
  }

  private array(name: string): Float32Array {
    return this.geometry.getAttribute(name).array as Float32Array;
  }

  private build(n: number): void {
    this.n = n;
    this.geometry.dispose();
    this.geometry = new BufferGeometry();
    const count = vertexCount(n);
    this.geometry.setIndex(new BufferAttribute(triangles(n), 1));
    for (const name of ["position", "normal"]) {
      this.geometry.setAttribute(name, new BufferAttribute(new Float32Array(3 * count), 3));
    }
    this.geometry.setAttribute("relief", new BufferAttribute(new Float32Array(count), 1));
    // pores and mottles stay where they are on the skin while it shrinks
    const rest = new Float32Array(3 * count);
    for (let i = 0, k = 0; i < n; i++) {
      const theta = ((i + 0.5) * Math.PI) / n;
      for (let j = 0; j < 2 * n; j++, k += 3) {
        const phi = (j * Math.PI) / n;
        rest.set([Math.sin(theta) * Math.cos(phi), Math.cos(theta), Math.sin(theta) * Math.sin(phi)], k);
      }
    }
    rest.set([0, 1, 0, 0, -1, 0], 6 * n * n);
    this.geometry.setAttribute("rest", new BufferAttribute(rest, 3));
  }

  /** Everything that follows from the positions. */
  private shape(): void {
    const position = this.array("position");
    const heights = this.array("relief");
    normals(position, this.geometry.index?.array ?? [], this.array("normal"));
    relief(position, this.n, REACH, heights);
    let square = 0;
    for (const h of heights) square += h * h;
    // almost smooth skins have no furrows to speak of
    this.depth = Math.max(0.018, Math.sqrt(square / heights.length));
    for (const name of ["position", "normal", "relief"]) this.geometry.getAttribute(name).needsUpdate = true;
    let lowest = Infinity;
    for (let k = 1; k < position.length; k += 3) lowest = Math.min(lowest, position[k]);
    this.position.y = -lowest;
    if (this.skin) this.wear(this.skin, this.dryness);
  }
}
