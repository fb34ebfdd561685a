// The room of a solver whose shapes are computed: a form, a job with its progress, and the stages of what it found.

import { keep, type House, type Room, type Verdict, type Words } from "../house";
import { Actions } from "../parts/actions";
import { Chart, type Curve } from "../parts/chart";
import { button, byId, details, digits, el, select, terms, withUnits, worded } from "../parts/dom";
import { Form } from "../parts/form";
import { Player } from "../parts/play";
import { needToken } from "../parts/token";
import { curves } from "../parts/curves";
import { Opening } from "../parts/opening";
import { absolute, Problem } from "../service/http";
import { ask, cancel, follow, isOf, job as findJob, nearest, numbers, result, stored, type Job, type Numbers } from "../service/jobs";
import { solver as askSolver, type Solver, type Values } from "../service/solvers";
import { Film } from "../view/film";

/** Longest request that a command line takes [characters]. */
const LINE = 20_000;
const QUALITIES = ["preview", "default", "fine"];

/** The room of a solver; `looked` says that its shapes can be looked up, too. */
export const job =
  (name: string, looked: boolean): Room =>
  async (house, words) =>
    new Work(house, await askSolver(name), words, looked).open();

class Work {
  private readonly form: Form;
  private readonly actions: Actions;
  private readonly player: Player;
  private readonly ending = new AbortController();
  private readonly stages = el("input", { type: "text", id: "stages", autocomplete: "off" });
  private readonly wrong = el("p", { class: "wrong", role: "status" });
  private readonly run = button("Run", () => void this.start(), { class: "primary" });
  private readonly halt = button("Stop", () => void this.stop());
  private readonly bar = el("progress", { max: "1", value: "0", "aria-label": "Progress of the job" });
  private readonly said = el("p", { role: "status", class: "note" });
  private readonly seen = el("section", { id: "seen", "aria-label": "The result" });
  private readonly scrub = el("input", { type: "range", id: "scrub", min: "0", max: "1000", step: "1" });
  private readonly value = el("span", { class: "value" });
  private readonly play: HTMLButtonElement;
  private readonly kept = el("div");
  private readonly opening: Opening;
  private preset: string;
  private quality = "preview";
  private colour = "auto";
  private film: Film | undefined;
  private found: Numbers | undefined;
  private charts: Chart[] = [];
  private running: Job | undefined;
  private loading: AbortController | undefined;
  private map: HTMLImageElement | undefined;
  private readonly legend = el("p", { class: "hint" });
  private closed = false;
  private own = "";

  constructor(
    private readonly house: House,
    private readonly solver: Solver,
    private readonly words: Words,
    private readonly looked: boolean,
  ) {
    const names = Object.keys(solver.presets);
    this.preset = names.includes(words.preset) ? words.preset : names[0];
    if (QUALITIES.includes(words.quality)) this.quality = words.quality;
    this.form = new Form(solver.params, this.important(), () => this.changed());
    this.actions = new Actions(() => this.take());
    this.opening = new Opening(solver.looks, () => this.film && void this.look(this.film.job));
    this.play = button("", () => this.player.toggle(Number(this.scrub.value) / 1000), { class: "play" });
    this.player = new Player(
      (share) => this.show(this.at(share)),
      (on) => this.filming(on),
    );
    this.scrub.addEventListener("input", () => {
      this.player.stop();
      this.show(this.at(Number(this.scrub.value) / 1000));
    });
    this.stages.addEventListener("input", () => this.changed());
  }

  async open(): Promise<() => void> {
    const { house, solver } = this;
    const presets = Object.keys(solver.presets).map((name): [string, string] => [name, worded(name)]);
    const qualities = QUALITIES.filter((name) => name in solver.qualities).map((name): [string, string] => [name, this.qualityWords(name)]);
    this.filming(false);
    this.seen.hidden = true;
    this.stopped();
    house.panel.replaceChildren(
      el("p", { id: "subject" }, solver.title, ...(this.looked ? [" · ", el("a", { href: `#room=${solver.name}` }, "look up instead")] : []), ...(solver.session ? [" · ", el("a", { href: `#room=${solver.name}&live=1` }, "work on it live")] : [])),
      this.seen,
      el(
        "section",
        { id: "controls", "aria-label": "What to compute" },
        select("Preset", "preset", presets, this.preset, (name) => this.choose(name)),
        el("div", { class: "field" }, el("label", { for: "stages" }, `Stages, ${solver.stages.long_name}${solver.stages.units === "1" ? "" : ` [${solver.stages.units}]`}`), this.stages),
        select("Quality", "quality", qualities, this.quality, (name) => {
          this.quality = name;
          this.changed();
        }),
        el("div", { class: "row" }, this.run, this.halt, this.bar),
        this.wrong,
        this.said,
        this.form.root,
      ),
      this.actions.root,
      this.kept,
    );
    this.choose(this.preset, false);
    this.paint();
    await this.arrive();
    return () => this.close();
  }

  /** Show what the address names, or what is stored of the preset, or else of this solver. */
  private async arrive(): Promise<void> {
    const { house, solver } = this;
    const all = await stored(solver.name).catch(() => []);
    if (this.closed) return;
    this.list(all);
    const named = this.words.job ? await findJob(this.words.job) : undefined;
    const fitting = all.find((one) => isOf(one, solver, this.preset));
    const shown = named?.state === "done" ? named : (fitting ?? (this.words.preset ? undefined : all[0]));
    if (shown && shown !== fitting) await this.adopt(shown);
    if (shown) void this.look(shown);
    else house.say(`${worded(this.preset)}: not computed yet`, "press Run", { level: "fair", text: "nothing to see yet", why: "No run of this preset is stored." });
    if (named && (named.state === "wanted" || named.state === "running")) void this.watch(named);
  }

  private close(): void {
    this.closed = true;
    this.ending.abort();
    this.loading?.abort();
    this.player.stop();
    this.film?.dispose();
  }

  /** Parameters worth a place above the fold: those with a word of their own, and what presets tell apart. */
  private important(): Set<string> {
    const labels = Object.keys(this.solver.looks.labels);
    const named = Object.values(this.solver.presets).flatMap((preset) => Object.keys(preset));
    const found = Object.keys(this.solver.params.properties).filter((name) => labels.some((label) => name.startsWith(label)));
    return new Set([...found, ...(found.length ? [] : named)]);
  }

  private qualityWords(name: string): string {
    const error = this.solver.qualities[name].relative_error;
    return `${name}${error === null ? "" : `, errs by ${digits(100 * error)} %`}`;
  }

  private choose(name: string, look = true): void {
    this.preset = name;
    const stages = this.solver.preset_stages[name] ?? this.solver.stages.default;
    this.stages.value = (this.words.stages && !look ? this.words.stages.split(",") : stages.map(String)).join(", ");
    this.form.set(this.solver.presets[name]);
    this.changed();
    if (look) {
      this.words.preset = name;
      delete this.words.job;
      void this.arrive();
    }
  }

  /** Fill the form with what a run was asked. */
  private async adopt(listed: Job): Promise<void> {
    const found = listed.omitted.length ? await findJob(listed.id) : listed;
    if (this.closed) return;
    this.preset = nearest(found, this.solver);
    (byId("preset") as HTMLSelectElement).value = this.preset;
    this.stages.value = found.need.stages.join(", ");
    this.form.set(found.params);
    this.changed();
  }

  private changed(): void {
    this.wrong.textContent = "";
    try {
      this.asked();
      this.run.disabled = this.running !== undefined;
    } catch (error) {
      this.wrong.textContent = (error as Error).message;
      this.run.disabled = true;
    }
    this.actions.refresh();
  }

  /** What the form asks for. */
  private asked(): { params: Values; stages: number[] } {
    const { lowest, highest, units } = this.solver.stages;
    const stages = this.stages.value.split(/[,;\s]+/).filter(Boolean).map(Number);
    if (!stages.length || stages.some((value) => !Number.isFinite(value))) throw new Error("Stages: write numbers with commas between.");
    const wrong = stages.find((value) => value < lowest || value > highest);
    if (wrong !== undefined) throw new Error(`Stages: ${digits(wrong)} is out of range, ${digits(lowest)} to ${withUnits(highest, units)}.`);
    return { params: this.form.values(this.solver.presets[this.preset]), stages };
  }

  /** What has to be kept to be shown: the surface, its colours, and numbers. */
  private fields(): string[] {
    const { fields, default_fields: usual, looks } = this.solver;
    const surface = "position" in fields ? "position" : "mesh_position";
    return [...new Set([surface, ...looks.layers, ...usual])].filter((name) => name in fields);
  }

  private async start(): Promise<void> {
    if (!(await needToken(`Run ${this.solver.title}`))) return;
    this.form.blame([]);
    try {
      const { params, stages } = this.asked();
      const need = { stages, quality: this.quality, fields: this.fields() };
      await this.watch(await ask({ solver: this.solver.name, preset: this.preset, params, need }));
    } catch (error) {
      if (this.closed) return;
      this.stopped();
      if (error instanceof Problem) this.form.blame(error.errors);
      this.said.textContent = error instanceof Problem ? error.message : String(error);
    }
  }

  private async watch(begun: Job): Promise<void> {
    this.running = begun;
    this.run.disabled = true;
    this.halt.hidden = this.bar.hidden = false;
    this.remember(begun);
    this.progress(begun);
    const ended = begun.state === "done" ? begun : await follow(begun, (now) => this.progress(now), this.ending.signal);
    if (this.closed) return;
    this.stopped();
    if (ended.state === "done") {
      this.list(await stored(this.solver.name));
      await this.look(ended, `Done in ${digits(ended.seconds ?? 0)} s.`);
    } else {
      const { detail, advice } = ended.problem ?? { detail: "The job was stopped.", advice: "" };
      this.said.textContent = ended.state === "cancelled" ? "The job was stopped." : `${detail} ${advice}`;
    }
  }

  private progress(now: Job): void {
    this.running = now;
    this.bar.value = now.progress.fraction;
    const expected = now.expected ? `, about ${digits(Math.ceil(now.expected.seconds))} s` : "";
    this.said.textContent = now.state === "running" ? `${Math.round(100 * now.progress.fraction)} % ${now.progress.message}` : `Waiting for its turn${expected} …`;
  }

  private stopped(): void {
    this.running = undefined;
    this.halt.hidden = this.bar.hidden = true;
    this.run.disabled = false;
  }

  private async stop(): Promise<void> {
    if (!this.running) return;
    try {
      await cancel(this.running);
    } catch (error) {
      this.said.textContent = error instanceof Problem ? error.message : String(error);
    }
  }

  private remember(found: Job): void {
    keep({ room: this.solver.name, run: "1", preset: this.preset, quality: this.quality, job: found.id });
    this.actions.refresh();
  }

  /** Fetch what a job computed and show its last stage; `ended` is what stays said when all are there. */
  private async look(found: Job, ended = ""): Promise<void> {
    this.loading?.abort();
    const loading = (this.loading = new AbortController());
    const film = new Film(found, { ...(this.colour === "auto" ? {} : { colour: this.colour }), ...this.opening.query });
    this.remember(found);
    try {
      const told = await numbers(found);
      const more = await curves(found, told, this.solver);
      if (loading.signal.aborted || this.closed) return;
      // the same run in other colours, or cut open: stay where it was, and keep the hand on what it holds
      const again = this.film?.job.id === found.id;
      const stage = again ? this.at(Number(this.scrub.value) / 1000) : film.stages[film.stages.length - 1];
      this.film?.dispose();
      this.film = film;
      this.found = told;
      this.house.content();
      if (!again) this.results(found, told, more);
      this.actions.refresh();
      this.house.stand(film);
      await film.load(
        film.nearest(stage),
        (there) => {
          this.said.textContent = there < film.stages.length ? `${ended} ${there} of ${film.stages.length} stages fetched`.trim() : ended;
          this.house.studio.aim();
          this.show(there === 1 ? stage : this.at(Number(this.scrub.value) / 1000));
        },
        loading.signal,
      );
    } catch (error) {
      this.house.complain(error);
    }
  }

  private at(share: number): number {
    const all = this.film?.stages ?? [0];
    return all[0] + share * (all[all.length - 1] - all[0]);
  }

  private show(stage: number): void {
    const { film, solver, house } = this;
    if (!film) return;
    const all = film.stages;
    const share = all.length > 1 ? (stage - all[0]) / (all[all.length - 1] - all[0]) : 1;
    this.scrub.value = String(Math.round(1000 * share));
    const { index, blended } = film.show(stage);
    const { symbol, units } = solver.stages;
    const where = `${symbol} = ${withUnits(blended ? Number(stage.toPrecision(3)) : all[Math.max(index, 0)], units)}`;
    this.scrub.style.setProperty("--share", String(share));
    this.scrub.setAttribute("aria-valuetext", where);
    this.value.textContent = where.split(" = ")[1];
    for (const chart of this.charts) chart.mark(stage);
    house.studio.reshaped();
    house.say(`${this.title(film.job)}, ${where}`, `a run, ${film.job.need.quality}${blended ? ", blended between stages" : ""}`, this.verdict(index));
    house.canvas.dataset.shown = JSON.stringify({ stage: all[Math.max(index, 0)], blended, of: all.length });
    if (!this.map) return;
    this.map.src = this.mapOf(all[Math.max(index, 0)]);
    this.legend.textContent = `${worded(this.layer())} over azimuth (across) and colatitude (down), dark 0 to bright 1.`;
  }

  private title(found: Job): string {
    const preset = Object.keys(this.solver.presets).find((name) => isOf(found, this.solver, name));
    return preset ? worded(preset) : `${worded(nearest(found, this.solver))}, changed`;
  }

  /** What the run says of the stage that is shown. */
  private verdict(index: number): Verdict {
    const value = (name: string): unknown => this.found?.fields[name]?.values[index];
    const residual = value("residual");
    const why = typeof residual === "number" ? `Residual ${residual.toExponential(1)}.` : "The solver gives no residual.";
    if (value("converged") === false || value("converged") === 0) return { level: "poor", text: "computed, not converged", why };
    const error = this.solver.qualities[this.film?.job.need.quality ?? ""]?.relative_error;
    if (typeof error === "number") return { level: error > 0.1 ? "fair" : "good", text: `converged, errs by about ${digits(100 * error)} %`, why };
    return { level: "fair", text: "converged, error of this quality not measured", why };
  }

  private results(found: Job, told: Numbers, more: Curve[]): void {
    const layers = ["auto", "none", ...this.solver.looks.layers.filter((name) => told.known.includes(name))];
    this.charts = more.map((curve) => new Chart(curve, this.solver.stages.units));
    const chosen = el("div", { class: "charts" });
    const pick = (name: string): void => chosen.replaceChildren(...this.charts.filter((_, i) => more[i].name === name).map((one) => one.root));
    const names = [...new Set(more.map((curve) => curve.name))];
    const lattice = told.known.includes("colatitude") && this.solver.looks.layers.length > 0;
    this.map = lattice ? el("img", { class: "map", alt: "", width: "512", height: "256" }) : undefined;
    this.seen.hidden = false;
    this.seen.replaceChildren(
      el("div", { class: "slider" }, el("label", { for: "scrub" }, `${this.word()} `, el("var", {}, this.solver.stages.symbol)), this.value, el("div", { class: "track" }, this.scrub)),
      el("div", { class: "row" }, this.play),
      ...(layers.length > 2
        ? [
            select("Colours", "colour", layers.map((name) => [name, name === "auto" ? "as it looks" : worded(name)]), this.colour, (name) => {
              this.colour = name;
              void this.look(found);
            }),
          ]
        : []),
      this.opening.root,
      ...(this.map ? [details("Map", false, this.legend, this.map)] : []),
      ...(names.length
        ? [
            details(
              "Curves",
              true,
              select("Over the stages", "curve", names.map((name) => [name, name]), names[0], pick),
              chosen,
            ),
          ]
        : []),
      details("Numbers", false, terms(more.map((curve) => [`${curve.name}, last stage`, withUnits(curve.y[curve.y.length - 1], curve.units)]))),
    );
    if (names.length) pick(names[0]);
    this.actions.refresh();
  }

  private word(): string {
    return this.solver.looks.labels[this.solver.stages.symbol]?.name ?? this.solver.stages.long_name;
  }

  private layer(): string {
    const { layers } = this.solver.looks;
    return layers.includes(this.colour) ? this.colour : layers[0];
  }

  private mapOf(stage: number): string {
    return this.film ? result(this.film.job, { format: "png", map: this.layer(), stage, size: 256, low: 0, high: 1 }) : "";
  }

  private filming(on: boolean): void {
    this.play.textContent = on ? "❚❚ Stop" : `▶ ${this.solver.looks.advance}`;
    this.play.setAttribute("aria-label", on ? "Stop the film" : this.solver.looks.advance);
  }

  /** A click on the shape goes into the form, where an entry has a place on the skin. */
  private paint(): void {
    const takers = this.form.takers("colatitude", "azimuth");
    if (!takers.length) return;
    let into: string | undefined;
    const choice = takers.map(({ name }) =>
      button(`Place ${worded(name)}`, () => {
        into = into === name ? undefined : name;
        for (const [i, one] of choice.entries()) one.setAttribute("aria-pressed", String(takers[i].name === into));
        hint.textContent = into ? `Click on the shape: each click is one more of ${worded(into)}. Then run again.` : "";
        byId("view").classList.toggle("aiming", into !== undefined);
      }, { "aria-pressed": "false" }),
    );
    const hint = el("p", { class: "hint", role: "status" });
    this.form.root.prepend(el("div", { class: "row" }, ...choice), hint);
    this.house.studio.picked = (at) => {
      const taker = takers.find(({ name }) => name === into);
      if (!taker || !this.film) return;
      const { x, y, z } = this.film.inFile(at);
      const colatitude = (Math.acos(y / Math.hypot(x, y, z)) * 180) / Math.PI;
      const azimuth = ((Math.atan2(z, x) * 180) / Math.PI + 360) % 360;
      taker.add({ colatitude: Number(colatitude.toFixed(1)), azimuth: Number(azimuth.toFixed(1)) });
      hint.textContent = `Added at colatitude ${colatitude.toFixed(0)}°, azimuth ${azimuth.toFixed(0)}°. Run to see what comes of it.`;
    };
  }

  /** What is stored of this solver, to go back to. */
  private list(all: Job[]): void {
    const own = all.slice(0, 20).map((one) => {
      const stages = one.need.stages;
      const range = `${digits(stages[0])} to ${withUnits(stages[stages.length - 1], this.solver.stages.units)}`;
      const open = button(this.title(one), () => {
        void this.adopt(one).then(() => this.look(one));
      });
      return el("li", {}, open, el("small", {}, `${one.need.quality}, ${this.solver.stages.symbol} ${range}`));
    });
    this.kept.replaceChildren(...(own.length ? [details(`Stored runs (${all.length})`, false, el("ul", { class: "kept" }, ...own))] : []));
  }

  private take(): ReturnType<ConstructorParameters<typeof Actions>[0]> {
    const { solver, film } = this;
    let said = "";
    let sent = "";
    let long = false;
    try {
      const { params, stages } = this.asked();
      const set = Object.entries(params).map(([name, value]) => ` --set '${name}=${typeof value === "string" ? value : JSON.stringify(value)}'`);
      said = `wizen solve ${solver.name} --preset ${this.preset}${set.join("")} --stages ${stages.join(",")} --quality ${this.quality} --out ${this.preset}.glb`;
      sent = JSON.stringify({ solver: solver.name, preset: this.preset, params, need: { stages, quality: this.quality, fields: this.fields() } });
      long = sent.length > LINE;
    } catch {
      // said beside the form
    }
    // a mesh is no matter for a command line
    if (this.own) URL.revokeObjectURL(this.own);
    this.own = long ? URL.createObjectURL(new Blob([sent], { type: "application/json" })) : "";
    const asked = long ? [{ label: "Job as JSON", href: this.own, name: "job.json" }] : [];
    const file = (label: string, format: string, primary = false) => ({ label, href: film ? result(film.job, { format, ...(format === "netcdf" ? {} : film.more) }) : "", primary });
    return {
      files: [...(film ? [file("Download GLB", "glb", true), file("USD", "usdc"), file("netCDF", "netcdf")] : []), ...asked],
      commands: said
        ? [
            ...(long ? [] : [{ label: "wizen", text: said }]),
            { label: "curl", text: `curl '${absolute("v1/jobs")}' -H "Authorization: Bearer $TOKEN" -H 'Content-Type: application/json' -d ${long ? "@job.json" : `'${sent.replace(/'/g, "'\\''")}'`}` },
          ]
        : [],
    };
  }
}
