// A surface that changes its vertices and triangles while somebody works on it.

import { Box3, BufferAttribute, BufferGeometry, DoubleSide, Group, Mesh, MeshPhysicalMaterial, type Object3D, Vector3 } from "three";
import type { Surface } from "../service/sessions";
import { copied, type Subject } from "./studio";

const SIZE = 1.7;

export class Sheet implements Subject {
  readonly object = new Group();
  height = SIZE;
  private readonly inner = new Group();
  private readonly mesh = new Mesh(
    new BufferGeometry(),
    new MeshPhysicalMaterial({ color: "#9fae6b", roughness: 0.55, clearcoat: 0.15, clearcoatRoughness: 0.5, side: DoubleSide }),
  );
  private reach = 0;

  constructor() {
    this.mesh.castShadow = this.mesh.receiveShadow = true;
    this.mesh.frustumCulled = false;
    this.mesh.visible = false; // drawn without normals once, its material would stay faceted
    this.mesh.rotation.x = -Math.PI / 2; // engines have z up
    this.inner.add(this.mesh);
    this.object.add(this.inner);
  }

  /** Take in a surface; its arrays may be changed afterwards. Returns whether it was set anew on the table. */
  take({ positions, triangles, rebuilt }: Surface): boolean {
    let { geometry } = this.mesh;
    if (rebuilt) {
      geometry.dispose();
      geometry = this.mesh.geometry = new BufferGeometry();
      geometry.setAttribute("position", new BufferAttribute(positions.slice(), 3));
      geometry.setIndex(new BufferAttribute(triangles.slice(), 1));
    } else {
      const position = geometry.getAttribute("position");
      (position.array as Float32Array).set(positions);
      position.needsUpdate = true;
    }
    geometry.computeVertexNormals();
    this.mesh.visible = true;
    geometry.computeBoundingSphere(); // rays look at it first
    return this.fit();
  }

  /** A place on the table in the engine's own coordinates. */
  inEngine(at: Vector3): Vector3 {
    return this.mesh.worldToLocal(this.object.localToWorld(at.clone()));
  }

  step(): boolean {
    return false;
  }

  frozen(): Object3D {
    return copied(this.object);
  }

  dispose(): void {
    this.mesh.geometry.dispose();
    this.mesh.material.dispose();
  }

  /** Stand on the table, anew only when it has outgrown its place: else it would jump under the brush. */
  private fit(): boolean {
    this.mesh.geometry.computeBoundingBox();
    const box = (this.mesh.geometry.boundingBox as Box3).clone();
    const size = box.getSize(new Vector3());
    const reach = Math.max(size.x, size.y, size.z);
    if (reach < 1.25 * this.reach && reach > 0.6 * this.reach) return false;
    this.reach = reach;
    const scale = SIZE / Math.max(reach, 1e-9);
    const middle = box.getCenter(new Vector3());
    this.inner.scale.setScalar(scale);
    this.inner.position.set(-scale * middle.x, -scale * box.min.z, scale * middle.y);
    this.height = scale * size.z;
    this.object.updateMatrixWorld(true);
    return true;
  }
}
