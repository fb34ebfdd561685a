// The room of many shapes: poured into a bowl or laid out in a field by the service, then dried all together.

import { keep, type House, type Room } from "../house";
import { Actions } from "../parts/actions";
import { button, counted, digits, el, select, terms, worded } from "../parts/dom";
import { Latest } from "../parts/live";
import { MeshFile } from "../parts/meshfile";
import { absolute, Problem } from "../service/http";
import { asToml, scene as askScene, type Ground, type Report, type Scene as Wanted } from "../service/scenes";
import { families, named, tables, type Table } from "../service/shapes";
import { solver } from "../service/solvers";
import { Crowd } from "../view/crowd";

const MOST = 1000;
/** Kinds to begin with. */
const FIRST = 3;
/** Length of the scene's unit [m]. */
const UNIT = 0.01;
const AGAIN = 3000; // [ms] until shapes are asked for again that did not come
const ON_MESH = "mesh";
/** Share of a mesh's area that feet may cover: past a half of it hardly any place is found by chance. */
const COVERED = 0.2;
const RULES: [string, string][] = [
  ["bowl", "in a bowl (falls until it rests)"],
  ["pile", "in a pile (falls until it rests)"],
  ["scatter", "scattered on the floor"],
  [ON_MESH, "scattered on a mesh of your own"],
  ["row", "in a row"],
];
/** From where one sees into a bowl, off the vertical [radian]. */
const INTO_BOWL = 0.75;
/** More than these take longer to fall than an answer may take. */
const FALLING = 150;
/** What any machine that draws this page turns without a jerk. */
const TRIANGLES = 300_000;
const CAMERA = { position: [0, 11, 16], target: [0, 1, 0], fov: 30, width: 1200, height: 800 };

interface Kind {
  preset: string;
  table: Table;
  chosen: boolean;
  /** Length of r1 [m], where such fruits have a size of their own. */
  metres?: number;
}

export const scene: Room = async (house, words) => {
  const [all, covered] = await Promise.all([tables(), families()]);
  const kinds: Kind[] = [];
  for (const family of covered) {
    const table = all.find((one) => one.name === family.name && !one.complaint);
    const preset = family.presets.find((name) => !kinds.some((kind) => kind.preset === name));
    if (!table || !preset) continue;
    const { sizes } = await solver(table.solver);
    kinds.push({ preset, table, chosen: false, metres: sizes[preset] });
  }
  if (kinds.length) await choose(kinds);
  if (!kinds.length) throw new Problem("No table holds a preset.", "Scenes are made of presets that tables hold: build one with `wizen table build`.", "");
  return new Many(house, kinds, words).open();
};

/** Begin with one of each of the first skins: the last of its presets, which are those worth a second try. */
async function choose(kinds: Kind[]): Promise<void> {
  const { looks, presets } = await solver(kinds[0].table.solver);
  const order = Object.keys(presets);
  for (const skin of Object.keys(looks.shades)) {
    if (kinds.filter((kind) => kind.chosen).length === FIRST) break;
    const worn = kinds.filter((kind) => kind.preset.startsWith(skin)).sort((a, b) => order.indexOf(b.preset) - order.indexOf(a.preset));
    if (worn.length) worn[0].chosen = true;
  }
  if (!kinds.some((kind) => kind.chosen)) kinds[0].chosen = true;
}

/** A number in whole parts by weights. */
const weighed = (total: number, weights: number[]): number[] => {
  const sum = weights.reduce((a, b) => a + b, 0);
  let [seen, given] = [0, 0];
  return weights.map((weight) => {
    seen += weight;
    const part = Math.round((total * seen) / sum) - given;
    given += part;
    return part;
  });
};

/** A number in so many whole parts, as even as may be. */
const shares = (total: number, parts: number): number[] =>
  Array.from({ length: parts }, (_, i) => Math.floor(total / parts) + (i < total % parts ? 1 : 0));

/** Length of r1 in the scene. */
const reach = ({ metres }: Kind): number => (metres ?? UNIT) / UNIT;

/** Area of a mesh, by half the cross products of its triangles. */
const areaOf = ({ points, faces }: Ground): number =>
  faces.reduce((sum, [a, b, c]) => {
    const [u, v] = [points[b], points[c]].map((p) => p.map((x, k) => x - points[a][k]));
    return sum + Math.hypot(u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]) / 2;
  }, 0);

class Many {
  private readonly counts = new Map<string, HTMLInputElement>();
  private readonly facts = el("section", { id: "trust", "aria-label": "What the service says of the scene" });
  private readonly said = el("p", { role: "status", class: "note" });
  private readonly rates = el("p", { class: "note", id: "rates" });
  private readonly dry = el("input", { type: "range", id: "dry" });
  private readonly value = el("span", { class: "value" });
  private readonly actions = new Actions(() => this.take());
  private readonly ground = new MeshFile("Mesh", () => void this.compose(), "They stand on its triangles, along their normals; y is up.", "");
  private readonly longest = el("input", { type: "number", id: "longest", min: "0.1", step: "any", placeholder: "as they need" });
  private readonly standing = el(
    "section",
    { "aria-label": "What they stand on" },
    this.ground.root,
    el("div", { class: "field" }, el("label", { for: "longest" }, "Longest side [cm]"), this.longest),
  );
  private readonly asking: Latest<number, Float32Array[]>;
  private readonly lowest: number;
  private readonly highest: number;
  private readonly symbol: string;
  private rule: string;
  private crowd: Crowd | undefined;
  private ending = new AbortController();
  private settled = 0;
  private turning = 0;
  private closed = false;
  private risen = false;
  private updates: number[] = [];

  constructor(
    private readonly house: House,
    private readonly kinds: Kind[],
    words: Record<string, string>,
  ) {
    this.lowest = Math.max(...kinds.map((kind) => kind.table.stage.lowest));
    this.highest = Math.min(...kinds.map((kind) => kind.table.stage.highest));
    this.symbol = kinds[0].table.stage.symbol;
    this.rule = RULES.some(([name]) => name === words.rule) ? words.rule : "bowl";
    const stage = Number(words.stage ?? NaN);
    const step = 10 ** (Math.floor(Math.log10(this.highest - this.lowest)) - 2);
    Object.assign(this.dry, { min: String(this.lowest), max: String(this.highest), step: String(step) });
    this.dry.value = String(Number.isFinite(stage) ? stage : this.lowest + 0.83 * (this.highest - this.lowest));
    const given = Number(words.count ?? NaN);
    // as much of each: few large ones, many small ones
    const weights = kinds.filter((kind) => kind.chosen).map((kind) => reach(kind) ** -3);
    const shared = weighed(Number.isFinite(given) ? Math.min(MOST, Math.max(1, given)) : 90, weights);
    for (const kind of kinds) {
      const count = kind.chosen ? shared.shift() : 0;
      this.counts.set(kind.preset, el("input", { type: "number", min: "0", max: String(MOST), value: String(count), id: `count-${kind.preset}` }));
    }
    this.asking = new Latest<number, Float32Array[]>(
      (stage) => this.looked(stage),
      (points, stage) => this.reshaped(points, stage),
      (error) => {
        house.complain(error);
        setTimeout(() => !this.closed && this.asking.put(this.stage), AGAIN);
      },
    );
  }

  open(): () => void {
    const { house } = this;
    for (const input of this.counts.values()) input.addEventListener("change", () => void this.compose());
    this.longest.addEventListener("change", () => void this.compose());
    this.standing.hidden = this.rule !== ON_MESH;
    this.dry.addEventListener("input", () => {
      this.word();
      this.asking.put(this.stage);
    });
    const turn = button("Measure frames", () => this.measure(), { title: "Turn the scene for two seconds and count" });
    house.panel.replaceChildren(
      el("p", { id: "subject" }, "Many shapes, each sent once"),
      el(
        "section",
        { id: "controls", "aria-label": "The scene" },
        el("div", { class: "slider" }, el("label", { for: "dry" }, "Dryness of all ", el("var", {}, this.symbol)), this.value, el("div", { class: "track" }, this.dry)),
        select("Placed", "rule", RULES, this.rule, (rule) => {
          this.rule = rule;
          this.standing.hidden = rule !== ON_MESH;
          void this.compose();
        }),
        this.standing,
        el(
          "fieldset",
          { class: "counts" },
          el("legend", {}, "How many of each"),
          ...this.kinds.map(({ preset }) => el("div", { class: "entry" }, el("label", { for: `count-${preset}` }, worded(preset)), this.counts.get(preset))),
        ),
        el("div", { class: "row" }, button("Settle again", () => void this.compose(), { title: "Let them fall anew, as dry as they are now" }), button("1,000 on the floor", () => this.thousand()), turn),
        this.said,
        this.rates,
      ),
      this.facts,
      this.actions.root,
    );
    this.word();
    void this.compose();
    return () => {
      this.closed = true;
      this.ending.abort();
      cancelAnimationFrame(this.turning);
      this.crowd?.dispose();
    };
  }

  private get stage(): number {
    return Number(Number(this.dry.value).toPrecision(4));
  }

  private word(): void {
    this.value.textContent = digits(this.stage);
    this.dry.setAttribute("aria-valuetext", digits(this.stage));
    this.dry.style.setProperty("--share", String((this.stage - this.lowest) / (this.highest - this.lowest)));
  }

  private thousand(): void {
    this.rule = "scatter";
    this.standing.hidden = true;
    (this.house.panel.querySelector("#rule") as HTMLSelectElement).value = this.rule;
    const used = [...this.counts.values()].filter((input) => Number(input.value) > 0);
    for (const [i, count] of shares(MOST, used.length).entries()) used[i].value = String(count);
    void this.compose();
  }

  private wanted(): Wanted {
    const items = this.kinds
      .map(({ preset, metres }) => ({ preset, metres, count: Math.round(Number(this.counts.get(preset)?.value)) }))
      .filter(({ count }) => count > 0)
      .map(({ preset, count, metres }) => ({ preset, stage: this.stage, count, seed: 3, vary: 0.15, size: metres ? ("real" as const) : 1, place: "here" }));
    const total = items.reduce((sum, { count }) => sum + count, 0);
    if (!total) throw new Problem("The scene is empty.", "Give at least one of the fruits a number.", "");
    if (items.some(({ count }) => !Number.isFinite(count) || count > MOST) || total > MOST) {
      throw new Problem(`${total} fruits are out of range, 1 to ${MOST}.`, "`wizen scene` takes up to 20,000.", "");
    }
    const falls = this.rule === "bowl" || this.rule === "pile";
    if (falls && total > FALLING) {
      throw new Problem(`${total} fruits take minutes to fall, longer than an answer may.`, `Take ${FALLING} at most, lay them on the floor, or run the command below.`, "");
    }
    const lengths = this.kinds.flatMap((kind) => (this.counts.get(kind.preset)?.value === "0" ? [] : [[Number(this.counts.get(kind.preset)?.value), reach(kind)]]));
    const bulk = Math.cbrt(lengths.reduce((sum, [count, r1]) => sum + count * r1 ** 3, 0));
    const widest = Math.max(...lengths.map(([, r1]) => r1));
    const ground = this.rule === ON_MESH ? this.grounded(Math.PI * lengths.reduce((sum, [count, r1]) => sum + count * r1 ** 2, 0)) : undefined;
    const radius = ground ? Math.max(...ground.points.flat().map(Math.abs)) : falls ? Math.max(3 * widest, 1.4 * bulk) : 1.5 * widest * Math.ceil(Math.sqrt(total));
    const rule = ground ? "scatter" : this.rule;
    const place = ground ? { name: "here", rule, seed: 1, mesh: ground } : { name: "here", rule, seed: 1, ...(this.rule === "bowl" || this.rule === "scatter" ? { radius: Number(radius.toFixed(2)) } : {}) };
    const far = radius / 6;
    const camera = { ...CAMERA, position: CAMERA.position.map((x) => Number((x * Math.max(1, far)).toFixed(2))) };
    return { unit: UNIT, cull: false, budget: { triangles: TRIANGLES }, camera, places: [place], items };
  }

  /** The mesh of one's own, as large as is said, else so that feet of this area find room [scene's unit]. */
  private grounded(feet: number): Ground {
    const given = this.ground.get() as Ground | null;
    if (!given) throw new Problem("There is no mesh to stand on yet.", "Choose a file.", "");
    const said = Number(this.longest.value) / 2;
    const half = said > 0 ? said : Math.sqrt(feet / (COVERED * areaOf(given)));
    return { points: given.points.map((point) => point.map((x) => Number((half * x).toPrecision(6)))), faces: given.faces };
  }

  /** Ask for the scene as it stands. */
  private async compose(): Promise<void> {
    this.ending.abort();
    const ending = (this.ending = new AbortController());
    const begin = performance.now();
    this.said.textContent = "The service places them …";
    this.house.content();
    try {
      const asked = this.wanted();
      keep({ room: "scene", rule: this.rule, stage: String(this.stage), count: String(asked.items.reduce((sum, one) => sum + one.count, 0)) });
      this.actions.refresh();
      const { data, report } = await askScene(asked, "glb", false, ending.signal);
      const crowd = await Crowd.of(data);
      if (ending.signal.aborted || this.closed) return;
      this.crowd?.dispose();
      this.crowd = crowd;
      this.settled = asked.items[0].stage;
      this.house.stand(crowd);
      if (!this.risen && this.rule === "bowl") this.house.studio.rise(INTO_BOWL);
      this.risen = true;
      this.told(report, performance.now() - begin);
      this.said.textContent = "";
    } catch (error) {
      this.said.textContent = "";
      this.actions.refresh();
      if (!ending.signal.aborted) this.house.complain(error);
    }
  }

  private told(report: Report, milliseconds: number): void {
    const still = Object.values((report.places ?? {}) as Record<string, { still: boolean }>).every((place) => place.still);
    this.facts.replaceChildren(
      terms([
        ["Fruits", `${report.shown} of ${report.instances} shown`],
        ["Distinct shapes", `${report.kinds}, as ${counted(report.meshes, "lattice")}`],
        ["Triangles drawn", report.triangles.toLocaleString("en")],
        ["File", `${(report.bytes / 1e6).toFixed(2)} MB, answered in ${(milliseconds / 1000).toFixed(1)} s`],
        ["At rest", still ? "yes" : "not all"],
      ]),
    );
    this.say(still);
    this.house.canvas.dataset.shown = JSON.stringify({ copies: this.crowd?.copies, stage: this.settled });
  }

  private say(still: boolean): void {
    const moved = Math.abs(this.stage - this.settled) > 1e-9;
    const text = moved ? "dried in place: settle again to let them fall" : still ? "placed by the service" : "not all at rest";
    this.house.say(`${counted(this.crowd?.copies ?? 0, "fruit")}, ${this.symbol} = ${digits(this.stage)}`, "looked up, one by one in the tables", {
      level: moved || !still ? "fair" : "good",
      text,
      why: "Shapes are exact look-ups; places are those of the stage that was settled.",
    });
  }

  /** Look up every lattice of the scene at another stage. */
  private looked(stage: number): Promise<Float32Array[]> {
    return Promise.all(
      (this.crowd?.lattices ?? []).map(async ({ kind, n }) => {
        const preset = kind.split(" ")[0];
        const table = (this.kinds.find((one) => one.preset === preset) as Kind).table;
        return (await named(table, preset, stage, n)).points;
      }),
    );
  }

  private reshaped(points: Float32Array[], stage: number): void {
    const { crowd, house } = this;
    house.content();
    if (!crowd || this.closed || points.length !== crowd.lattices.length) return;
    for (const [i, one] of crowd.lattices.entries()) crowd.reshape(one, points[i]);
    house.studio.reshaped();
    this.say(true);
    const now = performance.now();
    this.updates = [...this.updates.filter((at) => now - at < 1000), now];
    this.rates.textContent = `${this.updates.length} updates in the last second`;
    house.canvas.dataset.shown = JSON.stringify({ copies: crowd.copies, stage });
  }

  /** Turn the scene for two seconds and say how many frames were drawn. */
  private measure(): void {
    cancelAnimationFrame(this.turning);
    const { studio, canvas } = this.house;
    const begin = performance.now();
    let frames = 0;
    const next = (now: number): void => {
      if (this.closed) return;
      if (now - begin >= 2000) {
        const rate = (1000 * frames) / (now - begin);
        const { triangles, calls } = studio.renderer.info.render;
        this.rates.textContent = `${rate.toFixed(0)} frames/s, ${triangles.toLocaleString("en")} triangles in ${calls} calls`;
        canvas.dataset.rate = rate.toFixed(2);
        return;
      }
      frames++;
      studio.turn(0.02);
      this.turning = requestAnimationFrame(next);
    };
    this.turning = requestAnimationFrame(next);
  }

  private take(): ReturnType<ConstructorParameters<typeof Actions>[0]> {
    let asked: Wanted;
    try {
      asked = this.wanted();
    } catch {
      return { files: [], commands: [] };
    }
    const json = JSON.stringify(asked);
    const file = `data:application/toml;charset=utf-8,${encodeURIComponent(asToml(asked))}`;
    return {
      files: [{ label: "Scene as TOML", href: file, primary: true, name: "scene.toml" }],
      commands: [
        { label: "wizen", text: "wizen scene scene.toml --out scene.glb" },
        { label: "curl", text: `curl '${absolute("v1/scenes?format=glb")}' -H 'Content-Type: application/json' -d '${json}' -o scene.glb` },
      ],
    };
  }
}
