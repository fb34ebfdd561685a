// Meshes of one's own: read by the service, which knows the formats and what is wrong with a file.

import { allowed, get, Problem } from "./http";
import type { Values } from "./solvers";

/** Suffix -> media type. */
export const MESHES: Record<string, string> = {
  obj: "model/obj",
  ply: "model/ply",
  glb: "model/gltf-binary",
  stl: "model/stl",
};

export interface Given {
  mesh: Values;
  points: number;
  faces: number;
  borders: number;
  unit: number;
}

export async function readMesh(file: File): Promise<Given> {
  const kind = MESHES[file.name.split(".").pop()?.toLowerCase() ?? ""];
  const known = Object.keys(MESHES).map((name) => name.toUpperCase()).join(", ");
  if (!kind) throw new Problem(`${file.name} is no mesh that is known here.`, `Take one of ${known}.`, "");
  return (await get("v1/meshes", allowed({ method: "POST", headers: { "Content-Type": kind }, body: file }))).json();
}
