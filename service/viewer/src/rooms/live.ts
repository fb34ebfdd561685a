// The room of a live engine: paint on a surface while it grows, lay tools and solids on it, take back, save.

import { keep, type House, type Room, type Words } from "../house";
import { button, details, digits, el, select, worded } from "../parts/dom";
import { Form } from "../parts/form";
import { Calm } from "../parts/live";
import { needToken } from "../parts/token";
import { Problem } from "../service/http";
import { Session, type Saved, type State, type Surface } from "../service/sessions";
import { solver as askSolver, type Parameters, type Solver } from "../service/solvers";
import { Sheet } from "../view/sheet";

const BRUSH = "brush";
const LIFT = "lift";

export const live =
  (name: string): Room =>
  async (house, words) =>
    new Live(house, await askSolver(name), words).open();

class Live {
  private readonly sheet = new Sheet();
  private readonly said = el("p", { role: "status", class: "note" });
  private readonly counts = el("p", { class: "note", id: "counts" });
  private readonly begin = button("Begin", () => void this.start(), { class: "primary" });
  private readonly tools = el("section", { id: "tools-live", "aria-label": "Work on it" });
  private readonly saved = el("section", { id: "saved", "aria-label": "Saved" });
  private readonly paint = button("Paint", () => this.painting(!this.isPainting), { "aria-pressed": "false", title: "Drag over the shape to grow it; otherwise dragging turns it" });
  private readonly play = button("▶ Grow", () => this.session?.send(this.working ? "pause" : "play"));
  private readonly undo = button("Undo", () => this.session?.send("undo"));
  private readonly redo = button("Redo", () => this.session?.send("redo"));
  private readonly brush: Form | undefined;
  private readonly others: [string, Form][];
  private readonly words = new Calm();
  private session: Session | undefined;
  private working = false;
  private isPainting = false;
  private dabs = 0;
  private last = 0;
  private preset: string;
  private quality = "preview";

  constructor(
    private readonly house: House,
    private readonly solver: Solver,
    words: Words,
  ) {
    const names = Object.keys(solver.presets);
    this.preset = names.includes(words.preset) ? words.preset : names[0];
    const actions = Object.entries(solver.session?.actions ?? {});
    const form = ([name, schema]: [string, Parameters]): [string, Form] => {
      // where and which way the pointer says
      const { at: _, way: __, ...properties } = schema.properties;
      const made = new Form({ ...schema, properties: name === BRUSH ? properties : schema.properties }, new Set(Object.keys(schema.properties)), () => undefined);
      made.set({});
      return [name, made];
    };
    this.brush = actions.filter(([name]) => name === BRUSH).map(form)[0]?.[1];
    this.others = actions.filter(([name]) => name !== BRUSH && name !== LIFT).map(form);
  }

  open(): () => void {
    const { house, solver } = this;
    if (!solver.session) throw new Problem(`${solver.title} offers no live engine.`, "Its room runs jobs.", "");
    const presets = Object.keys(solver.presets).map((name): [string, string] => [name, worded(name)]);
    house.panel.replaceChildren(
      el("p", { id: "subject" }, `${solver.title}, live · `, el("a", { href: `#room=${solver.name}&run=1` }, "as a job instead")),
      el(
        "section",
        { id: "controls", "aria-label": "What to begin with" },
        select("Begin with", "preset", presets, this.preset, (name) => (this.preset = name)),
        select("Quality", "quality", Object.keys(solver.qualities).map((name) => [name, name]), this.quality, (name) => {
          this.quality = name;
          this.session?.send("quality", { quality: name });
        }),
        el("div", { class: "row" }, this.begin),
        this.said,
        this.counts,
      ),
      this.tools,
      this.saved,
    );
    this.tools.hidden = true;
    this.lay();
    house.say(`${worded(this.preset)}: not begun`, "press Begin", { level: "fair", text: "nothing to see yet", why: "No session is open." });
    const leave = (): void => this.session?.close(); // else the service keeps it for who comes back
    addEventListener("pagehide", leave);
    return () => {
      removeEventListener("pagehide", leave);
      leave();
      this.words.stop();
      this.painting(false);
      this.sheet.dispose();
    };
  }

  private lay(): void {
    const middle = button("Dab in the middle", () => this.dabInMiddle(), { title: "As the brush does, where the view's middle is: for keyboards" });
    this.tools.replaceChildren(
      el("div", { class: "row" }, this.play, this.undo, this.redo, button("Settle", () => this.session?.send("settle"), { title: "Settle as far as a batch run does" }), button("Save as TOML", () => this.session?.send("save"))),
      ...(this.brush ? [el("div", { class: "row" }, this.paint, middle), details("Brush", true, this.brush.root)] : []),
      ...this.others.map(([name, form]) => details(worded(name), false, form.root, el("div", { class: "row" }, button(`Do: ${worded(name)}`, () => this.act(name, form))))),
    );
  }

  private async start(): Promise<void> {
    if (!(await needToken(`Grow ${this.preset} live`))) return;
    this.session?.close();
    this.dabs = this.last = 0;
    this.said.textContent = "Asking for an engine …";
    keep({ room: this.solver.name, live: "1", preset: this.preset });
    const first = { preset: this.preset, quality: this.quality };
    this.session = new Session(this.solver.session?.address ?? "", first, {
      opened: ({ session }) => {
        this.said.textContent = "";
        this.begin.textContent = "Begin anew";
        this.tools.hidden = false;
        this.house.canvas.dataset.session = session;
        this.house.content();
        this.house.stand(this.sheet);
        if (this.brush) this.painting(true);
      },
      surface: (surface) => this.frame(surface),
      state: (state) => this.told(state),
      done: () => undefined,
      saved: (saved) => this.keepFile(saved),
      problem: (problem) => this.house.complain(problem),
      over: (why, toml) => {
        this.said.textContent = `The session is over: ${why}`;
        this.tools.hidden = true;
        if (toml) this.keepFile({ toml, command: "" });
      },
    });
  }

  private frame(surface: Surface): void {
    const { house, sheet } = this;
    if (sheet.take(surface)) house.studio.aim();
    house.studio.reshaped();
    if (!surface.underway) this.dabs = Math.max(this.dabs, surface.input);
    this.words.do(() => this.tell(surface));
    house.canvas.dataset.shown = JSON.stringify({ stage: surface.stage, vertices: surface.positions.length / 3, input: this.dabs, exact: surface.exact, underway: surface.underway });
  }

  private tell(surface: Surface): void {
    const { symbol } = this.solver.stages;
    this.house.say(`${worded(this.preset)}, ${symbol} = ${digits(surface.stage)}`, `live, ${this.quality}`, {
      level: surface.exact ? "good" : "fair",
      text: surface.exact ? "settled as a batch run settles" : surface.residual ? `${surface.underway ? "on its way" : "live"}: residual ${surface.residual.toExponential(1)}` : "as it begins",
      why: "Settle brings it to the equilibrium that a batch run of the saved file gives.",
    });
    this.counts.textContent = `${(surface.positions.length / 3).toLocaleString("en")} vertices, ${(surface.triangles.length / 3).toLocaleString("en")} triangles`;
  }

  private told({ working, until, undo, redo, crossings }: State): void {
    this.working = working && until !== 0;
    this.play.textContent = this.working ? "❚❚ Pause" : `▶ ${this.solver.looks.advance}`;
    this.undo.disabled = undo === 0;
    this.redo.disabled = redo === 0;
    this.said.textContent = crossings ? `The sheet passes through itself in ${crossings} pairs of triangles.` : "";
    Object.assign(this.house.canvas.dataset, { undo: String(undo), redo: String(redo) });
  }

  private painting(on: boolean): void {
    this.isPainting = on;
    this.paint.setAttribute("aria-pressed", String(on));
    this.house.canvas.classList.toggle("aiming", on);
    this.house.studio.stroke = on
      ? {
          dab: (at) => {
            // the next one once a frame has the one before: strokes follow the engine, they do not pile up
            if (this.last > this.dabs) return;
            const { x, y, z } = this.sheet.inEngine(at);
            this.dab([x, y, z]);
          },
          end: () => this.session?.send(LIFT),
        }
      : undefined;
  }

  private dab(at: number[]): void {
    try {
      this.last = this.session?.send(BRUSH, { at, ...this.brush?.values() }) ?? 0;
    } catch (error) {
      this.house.complain(new Problem((error as Error).message, "", ""));
    }
  }

  private dabInMiddle(): void {
    const at = this.house.studio.middle();
    if (!at) return;
    const { x, y, z } = this.sheet.inEngine(at);
    this.dab([x, y, z]);
    this.session?.send(LIFT);
  }

  private act(name: string, form: Form): void {
    try {
      this.house.content();
      this.session?.send(name, form.values());
    } catch (error) {
      this.house.complain(new Problem((error as Error).message, "", ""));
    }
  }

  private keepFile({ toml, command }: Saved): void {
    const href = `data:application/toml;charset=utf-8,${encodeURIComponent(toml)}`;
    this.saved.replaceChildren(
      el("div", { class: "row" }, el("a", { class: "button primary", href, download: `${this.preset}-live.toml` }, "Download TOML")),
      el("pre", { class: "toml", tabindex: "0", "aria-label": "The session as a parameter file" }, toml),
      ...(command ? [el("p", { class: "hint" }, "The same bytes without a session: ", el("code", {}, command))] : []),
    );
  }
}
