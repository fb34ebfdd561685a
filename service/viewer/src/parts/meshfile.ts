// A mesh as a value of a form: a file that the service reads, or none.

import { Problem } from "../service/http";
import { MESHES, readMesh } from "../service/meshes";
import { button, counted, el } from "./dom";
import { needToken } from "./token";

interface Sized {
  points?: unknown[];
  faces?: unknown[];
}

export class MeshFile {
  readonly root: HTMLElement;
  private value: Sized | null = null;
  private readonly said = el("p", { class: "note", role: "status" });
  private readonly wrong = el("p", { class: "wrong", role: "alert" });
  private readonly input: HTMLInputElement;
  private readonly out: HTMLButtonElement;

  constructor(
    label: string,
    private readonly changed: () => void,
    hint = "Its middle becomes the origin, half its longest side 1.",
    private readonly next = "Run to see what comes of it.",
  ) {
    const accept = Object.keys(MESHES).map((suffix) => `.${suffix}`).join(",");
    this.input = el("input", { type: "file", accept, "aria-label": `${label}: a file` });
    this.out = button(`Without the ${label.toLowerCase()}`, () => {
      this.set(null);
      changed();
    });
    this.input.addEventListener("change", () => void this.take());
    this.root = el("div", { class: "meshfile" }, el("p", { class: "hint" }, `OBJ, PLY, GLB or STL. ${hint}`), this.input, this.said, this.wrong, this.out);
    this.set(null);
  }

  get(): unknown {
    return this.value;
  }

  set(value: unknown): void {
    this.value = (value as Sized | null | undefined) ?? null;
    this.wrong.textContent = "";
    this.out.hidden = this.value === null;
    if (this.value === null) this.input.value = "";
    this.said.textContent = this.value === null ? "" : `${counted(this.value.points?.length ?? 0, "point")}, ${counted(this.value.faces?.length ?? 0, "triangle")}`;
  }

  private async take(): Promise<void> {
    const file = this.input.files?.[0];
    if (!file) return;
    this.wrong.textContent = "";
    if (!(await needToken("Read a mesh"))) return;
    this.said.textContent = `Reading ${file.name} …`;
    try {
      const given = await readMesh(file);
      this.set(given.mesh);
      const border = given.borders ? `open, ${counted(given.borders, "edge")} with one triangle` : "closed";
      this.said.textContent = `${file.name}: ${this.said.textContent}, ${border}. ${this.next}`;
    } catch (error) {
      this.set(null);
      this.wrong.textContent = error instanceof Problem ? error.message : String(error);
    }
    this.changed();
  }
}
