// The room of shapes that are looked up: catalogue -> sliders -> questions -> mesh.

import { fromHash, keep, type House, type Room, type Words } from "../house";
import { Actions } from "../parts/actions";
import { Choice, Slider } from "../parts/controls";
import { Detail } from "../parts/detail";
import { button, counted, details, digits, el } from "../parts/dom";
import { Exact } from "../parts/exact";
import { familyChoice, familyOf, titled } from "../parts/families";
import { Calm, Latest } from "../parts/live";
import { Player } from "../parts/play";
import { at, clamp, presetsIn, scales, shareOf, type Scale } from "../parts/state";
import { showFacts, showTrust, tierOf, verdict } from "../parts/trust";
import { absolute, Problem } from "../service/http";
import { address, families as askFamilies, shape, type Answer, type Asked, type Family, type Point, type Table } from "../service/shapes";
import { solver as askSolver, type Solver } from "../service/solvers";
import { Fruit } from "../view/fruit";
import { dressed, type Look } from "../view/looks";

const REST = 160; // [ms] without a change after which the finest shape is asked for
const AGAIN = 3000; // [ms] until a silent service is asked again

interface Question extends Asked {
  moving: boolean;
}

/** Methods of look-up worth a button, in words; a table's default goes before them. */
const METHODS: Record<string, string> = { idw: "Paper's IDW", linear: "Linear", nearest: "Nearest run" };

/** The room over these tables of one solver. */
export const table =
  (all: Table[]): Room =>
  async (house, words) => {
    const usable = all.filter((one) => !one.complaint);
    if (!usable.length) {
      throw new Problem(
        all[0]?.complaint ?? "There is no table yet.",
        "Run a sweep and `wizen table build`; this page shows it as soon as it is there.",
        "",
      );
    }
    // only a preset needs to know what the tables cover before the first picture
    const covered = askFamilies();
    const family = words.preset ? familyOf(await covered, words.preset) : undefined;
    const names = [words.table ?? family?.name, "default", "sphere"];
    const first = names.map((name) => usable.find((one) => one.name === name)).find((found) => found !== undefined);
    const chosen = first ?? usable[0];
    return new Shapes(house, chosen, await askSolver(chosen.solver), words).open(covered);
  };

class Shapes {
  private readonly look: Look;
  private readonly axes: Scale[];
  private readonly stage: Scale;
  private readonly point: Point = {};
  private readonly fruit = new Fruit();
  private readonly detail: Detail;
  private readonly trust = el("section", { id: "trust", "aria-label": "How far to trust this shape" });
  private readonly facts = details("Numbers", false, el("div"));
  private readonly outside = el("p", { class: "hint", role: "status" });
  private readonly exact: Exact;
  private readonly actions: Actions;
  private readonly player: Player;
  private readonly sliders: Slider[];
  private readonly questions: Latest<Question, Answer>;
  /** Laying words out costs as much as the shape: nobody reads them thirty times a second. */
  private readonly words = new Calm();
  private readonly taken = new Calm();
  private skin: string;
  private method: string;
  private resting = 0;
  private closed = false;

  constructor(
    private readonly house: House,
    private readonly table: Table,
    private readonly solver: Solver,
    private readonly wanted: Words,
  ) {
    this.look = dressed(solver.looks);
    this.axes = scales(table);
    [this.stage] = this.axes;
    for (const scale of this.axes) {
      const given = wanted[scale.name] === undefined ? NaN : Number(wanted[scale.name]);
      this.point[scale.name] = Number.isFinite(given) ? clamp(scale, given) : at(scale, scale === this.stage ? 0.8 : 0.35);
    }
    const meant = presetsIn(table, solver)[wanted.preset ?? ""] ?? {};
    for (const [name, value] of Object.entries(meant)) if (wanted[name] === undefined) this.point[name] = value;
    const shades = Object.keys(this.look.shades);
    this.skin = wanted.skin in this.look.shades ? wanted.skin : skinOf(shades, [wanted.preset ?? "", table.name, ...Object.keys(presetsIn(table, solver))]);
    this.method = table.methods.known.includes(wanted.method) ? wanted.method : table.methods.default;
    this.detail = new Detail(table.max_resolution);
    this.actions = new Actions(() => this.take());
    this.exact = new Exact(
      () => this.asked(this.detail.finest),
      (answer, asked) => {
        // whoever has gone on meanwhile is not thrown back
        if (this.closed || JSON.stringify(asked.point) !== JSON.stringify(this.point)) return false;
        this.display(answer, asked.point, false);
        return true;
      },
    );
    this.player = new Player(
      (share) => this.set({ [this.stage.name]: at(this.stage, share) }),
      (on) => this.filming(on),
    );
    this.sliders = this.axes.map((scale) => this.slider(scale));
    this.questions = new Latest<Question, Answer>(
      (q) => shape(q),
      (answer, q, last) => this.answered(answer, q, last),
      (error) => this.failed(error),
    );
  }

  /** Show the first shape, then what else there is; returns what closes the room. */
  open(covered: Promise<Family[]>): () => void {
    const { house } = this;
    house.stand(this.fruit);
    this.facts.addEventListener("toggle", () => this.number());
    const choice = el("div", { class: "choice families-wait" });
    house.panel.replaceChildren(
      el("p", { id: "subject" }, `${this.solver.title} · ${counted(this.table.samples)} · `, el("a", { href: `#room=${this.solver.name}&run=1` }, "all parameters")),
      this.controls(choice),
      this.exact.root,
      this.trust,
      this.actions.root,
      this.facts,
    );
    void covered.then(
      (all) => {
        const own = all.filter((family) => family.solver === this.solver.name);
        if (own.length > 1) choice.replaceWith(familyChoice(own, this.table.name, (family) => visit(family)));
        else choice.remove();
        const mine = own.find((family) => family.name === this.table.name);
        if (mine) this.name = titled(mine);
        this.caption();
      },
      () => choice.remove(),
    );
    this.set({});
    return () => {
      this.closed = true;
      this.player.stop();
      clearTimeout(this.resting);
      this.words.stop();
      this.taken.stop();
    };
  }

  private name = "";
  private shown: { answer: Answer; at: Point } | undefined;
  private play = button("", () => this.player.toggle(shareOf(this.stage, this.point[this.stage.name])), { class: "play" });
  private places: Choice | undefined;

  private asked(resolution: number): Asked {
    return { table: this.table, point: { ...this.point }, resolution, method: this.method };
  }

  private take(): ReturnType<ConstructorParameters<typeof Actions>[0]> {
    const asked = this.asked(this.detail.finest);
    const file = (format: string): string => address(asked, format);
    const { [this.stage.name]: stage, ...others } = this.point;
    const said = Object.entries(others).map(([name, value]) => `--set ${name}=${digits(value)}`);
    said.push(`--stages ${digits(stage)}`, `--name ${this.table.name}`);
    if (this.method !== this.table.methods.default) said.push(`--method ${this.method}`);
    return {
      files: [
        { label: "Download GLB", href: file("glb"), primary: true },
        { label: "OBJ", href: file("obj") },
      ],
      commands: [
        { label: "curl", text: `curl '${absolute(file("glb"))}' -o ${this.solver.name}.glb` },
        { label: "wizen", text: `wizen query ${said.join(" ")} --resolution ${asked.resolution} --out ${this.solver.name}.glb` },
      ],
    };
  }

  private display(answer: Answer, point: Point, moving: boolean): void {
    const { house, fruit } = this;
    house.content();
    fruit.wear(this.look.shades[this.skin], shareOf(this.stage, point[this.stage.name]));
    fruit.show(answer.points, answer.n, moving);
    house.studio.reshaped();
    this.shown = { answer, at: point };
    if (moving) this.words.do(() => this.tell(answer));
    else {
      this.words.stop();
      this.tell(answer);
    }
    Object.assign(house.canvas.dataset, {
      shown: JSON.stringify({ n: answer.n, ...point }),
      method: answer.about.method,
      exact: String(answer.about.exact),
      tier: answer.about.tier,
    });
  }

  private tell(answer: Answer): void {
    showTrust(this.trust, answer.about, `${answer.milliseconds.toFixed(0)} ms, ${(answer.bytes / 1024).toFixed(0)} kB`);
    if (this.facts.open) this.number();
    this.caption();
  }

  private number(): void {
    if (this.shown) showFacts(this.facts.querySelector("div") as HTMLElement, this.shown.answer.about);
  }

  private caption(): void {
    if (!this.shown || this.closed) return;
    const { answer, at: point } = this.shown;
    const stage = `${this.stage.name} = ${digits(point[this.stage.name])}`;
    this.house.say(`${this.name || this.table.name}, ${stage}`, tierOf(answer.about), verdict(answer.about));
  }

  private answered(answer: Answer, q: Question, last: boolean): void {
    if (this.closed) return;
    // the finest comes late: whoever has gone on meanwhile is not thrown back, the next answer is under way
    if (!q.moving && JSON.stringify(q.point) !== JSON.stringify(this.point)) return;
    if (q.moving) this.detail.learn(q.resolution, answer.milliseconds);
    this.display(answer, q.point, q.moving);
    if (!q.moving) this.exact.judge(answer.about);
    if (last && q.moving) this.rest();
  }

  private failed(error: unknown): void {
    if (this.closed) return;
    this.house.complain(error);
    this.exact.refused(error);
    setTimeout(() => !this.closed && this.rest(), AGAIN);
  }

  private ask(moving: boolean): void {
    this.questions.put({ ...this.asked(this.detail.of(moving)), moving });
  }

  private rest(): void {
    clearTimeout(this.resting);
    // what a hand did while the page was busy drawing comes first
    this.resting = window.setTimeout(() => (this.resting = window.setTimeout(() => this.ask(false), 0)), REST);
  }

  private changed(): void {
    this.ask(true);
    this.rest();
    this.taken.do(() => this.actions.refresh());
    this.keep();
  }

  private keep(): void {
    const words: Words = { ...(this.wanted.room ? { room: this.wanted.room } : {}), table: this.table.name, skin: this.skin };
    if (this.method !== this.table.methods.default) words.method = this.method;
    for (const [name, value] of Object.entries(this.point)) words[name] = String(Number(value.toPrecision(4)));
    keep(words);
  }

  private slider(scale: Scale): Slider {
    return new Slider(
      scale,
      this.look,
      (value) => {
        if (scale === this.stage) this.player.stop();
        this.places?.mark(undefined);
        this.outside.textContent = "";
        this.point[scale.name] = value;
        this.changed();
      },
      (said) => (this.outside.textContent = `${said} Outside of it, \`wizen solve\` or a job runs the solver.`),
    );
  }

  private set(values: Point): void {
    for (const slider of this.sliders) {
      const { name } = slider.scale;
      if (name in values) this.point[name] = clamp(slider.scale, values[name]);
      slider.set(this.point[name]);
    }
    this.changed();
  }

  private filming(on: boolean): void {
    this.play.textContent = on ? "❚❚ Stop" : `▶ ${this.look.advance}`;
    this.play.setAttribute("aria-label", on ? "Stop" : this.look.advance);
  }

  private controls(choice: HTMLElement): HTMLElement {
    this.filming(false);
    const presets = presetsIn(this.table, this.solver);
    const spots: Record<string, Point> = Object.fromEntries(
      Object.entries(this.look.places).map(([name, place]) => [name, { ...shares(this.axes, place.shares), [this.stage.name]: place.stage }]),
    );
    const places = new Choice("Looks", [...Object.keys(spots), ...Object.keys(presets)], (name) => {
      this.player.stop();
      this.set(spots[name] ?? presets[name]);
      places.mark(name);
    });
    this.places = places;
    const [first, ...others] = this.sliders.map((slider) => slider.root);
    return el(
      "section",
      { id: "controls", "aria-label": "Parameters" },
      choice,
      first,
      el("div", { class: "row" }, this.play),
      ...others,
      this.outside,
      places.root,
      this.skins().root,
      this.ways().root,
    );
  }

  private skins(): Choice {
    const { shades } = this.look;
    const skins = new Choice(
      "Skin",
      Object.keys(shades),
      (name) => {
        this.skin = name;
        skins.mark(name);
        this.fruit.wear(shades[name], shareOf(this.stage, this.point[this.stage.name]));
        this.house.studio.invalidate();
        this.keep();
      },
      (name, made) => {
        const swatch = el("i", { class: "swatch", "aria-hidden": "true" });
        swatch.style.setProperty("--fresh", shades[name].ridge[0]);
        swatch.style.setProperty("--dry", shades[name].ridge[1]);
        made.prepend(swatch);
      },
    );
    skins.mark(this.skin);
    return skins;
  }

  private ways(): Choice {
    const named: Record<string, string> = { Default: this.table.methods.default };
    for (const name of this.table.methods.known) if (name in METHODS) named[METHODS[name]] ??= name;
    const ways = new Choice(
      "Look-up",
      Object.keys(named),
      (word) => {
        this.method = named[word];
        ways.mark(word);
        this.changed();
      },
      (word, made) => (made.title = named[word]),
    );
    ways.mark(Object.keys(named).find((word) => named[word] === this.method));
    return ways;
  }
}

/** The skin whose name begins one of these, else the first. */
const skinOf = (shades: string[], names: string[]): string =>
  names.map((one) => shades.find((shade) => one.startsWith(shade))).find((found) => found !== undefined) ?? shades[0];

const shares = (axes: Scale[], given: Record<string, number>): Point =>
  Object.fromEntries(axes.filter((axis) => axis.name in given).map((axis) => [axis.name, at(axis, given[axis.name])]));

/** Go to another family, to where its picture was taken. */
function visit(family: Family): void {
  const { room } = fromHash();
  const words = new URLSearchParams({ ...(room ? { room } : {}), table: family.name });
  for (const [name, value] of Object.entries(family.portrait)) words.set(name, String(value));
  location.hash = words.toString();
}
