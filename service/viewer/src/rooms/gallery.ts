// The room of all presets: pictures of tables, of stored runs, and where nothing is stored those that come with wizen.

import type { House, Room } from "../house";
import { counted, el, worded } from "../parts/dom";
import { ranges, titled } from "../parts/families";
import { relative } from "../service/http";
import { isOf, stored, type Job } from "../service/jobs";
import { families, type Family } from "../service/shapes";
import { solver as askSolver, type Entry, type Solver } from "../service/solvers";
import { Film } from "../view/film";

const PIXELS = 240;

export const gallery =
  (entries: Entry[]): Room =>
  async (house) => {
    const ending = new AbortController();
    const [covered, ...found] = await Promise.all([
      families().catch(() => [] as Family[]),
      ...entries.map(async ({ name }) => ({ solver: await askSolver(name), jobs: await stored(name).catch(() => [] as Job[]) })),
    ]);
    const painter = new Painter(house, ending.signal);
    house.cover(
      el("div", { class: "gallery" }, ...found.map(({ solver, jobs }, i) => shelf(entries[i], solver, covered, jobs, painter))),
    );
    return () => {
      ending.abort();
      painter.stop();
    };
  };

/** One solver's presets. */
function shelf(entry: Entry, solver: Solver, covered: Family[], jobs: Job[], painter: Painter): HTMLElement {
  const own = covered.filter((family) => family.solver === entry.name);
  const cards = Object.keys(solver.presets).map((preset) => {
    const family = own.find((one) => one.presets.includes(preset));
    const job = jobs.find((one) => isOf(one, solver, preset));
    return { rank: family ? 0 : job ? 1 : 2, root: card(entry, solver, preset, family, job, painter) };
  });
  const others = own.filter((family) => !family.presets.length).map((family) => ({ rank: 0, root: tableCard(entry, family, own) }));
  const all = [...cards, ...others].sort((a, b) => a.rank - b.rank);
  const there = all.filter(({ rank }) => rank < 2).length;
  return el(
    "section",
    { "aria-label": entry.title },
    el("h2", {}, entry.advance, " ", el("small", {}, `${entry.title} · ${there} of ${all.length} there to see`)),
    el("ul", { class: "cards" }, ...all.map(({ root }) => root)),
  );
}

function card(entry: Entry, solver: Solver, preset: string, family: Family | undefined, job: Job | undefined, painter: Painter): HTMLElement {
  const words = new URLSearchParams({ room: entry.name, preset });
  if (family) {
    words.set("table", family.name);
    for (const [name, value] of Object.entries(family.portrait)) words.set(name, String(value));
  } else {
    words.set("run", "1");
    if (job) words.set("job", job.id);
  }
  const { symbol, units } = solver.stages;
  const at = (stage: number): string => `${symbol} = ${stage}${units === "1" ? "" : ` ${units}`}`;
  const portrait = solver.portraits[preset];
  const last = job?.need.stages[job.need.stages.length - 1];
  const note = family
    ? `live, ${counted(family.samples)}`
    : job
      ? `a run, ${symbol} to ${last}${units === "1" ? "" : ` ${units}`}`
      : portrait
        ? `not computed here; at ${at(portrait.stage)}`
        : "not computed yet";
  const picture = family
    ? drawn(family.links.thumbnail)
    : job
      ? painter.frame(job)
      : portrait
        ? drawn(portrait.href)
        : el("span", { class: "empty", "aria-hidden": "true" }, "no run stored");
  return linked(`#${words}`, worded(preset), note, picture);
}

function tableCard(entry: Entry, family: Family, all: Family[]): HTMLElement {
  const words = new URLSearchParams({ room: entry.name, table: family.name });
  for (const [name, value] of Object.entries(family.portrait)) words.set(name, String(value));
  return linked(`#${words}`, titled(family), `live, ${ranges(family, all).join(", ")}`, drawn(family.links.thumbnail));
}

const drawn = (address: string): HTMLElement =>
  el("img", { src: relative(address), alt: "", width: "144", height: "144", loading: "lazy" });

const linked = (href: string, name: string, note: string, picture: HTMLElement): HTMLElement =>
  el("li", {}, el("a", { href }, picture, el("span", {}, name), el("small", {}, note)));

/** Draws stored runs into their frames, one after the other, when they come into sight. */
class Painter {
  private readonly waiting = new Map<Element, Job>();
  private readonly queue: Element[] = [];
  private busy = false;
  private readonly eye = new IntersectionObserver((seen) => {
    for (const { target, isIntersecting } of seen) {
      if (!isIntersecting) continue;
      this.eye.unobserve(target);
      this.queue.push(target);
    }
    if (!this.busy) void this.work();
  });

  constructor(
    private readonly house: House,
    private readonly signal: AbortSignal,
  ) {}

  frame(job: Job): HTMLElement {
    const canvas = el("canvas", { width: String(PIXELS), height: String(PIXELS), "aria-hidden": "true" });
    this.waiting.set(canvas, job);
    this.eye.observe(canvas);
    return canvas;
  }

  stop(): void {
    this.eye.disconnect();
    this.queue.length = 0;
  }

  private async work(): Promise<void> {
    this.busy = true;
    for (let next = this.queue.shift(); next && !this.signal.aborted; next = this.queue.shift()) {
      const job = this.waiting.get(next) as Job;
      const film = new Film({ ...job, need: { ...job.need, stages: job.need.stages.slice(-1) } });
      try {
        await film.load(0, () => film.show(film.stages[0]), this.signal);
        this.house.studio.portrait(film, next as HTMLCanvasElement);
        next.classList.add("drawn");
      } catch {
        // a result that cannot be drawn keeps its empty frame
      }
      film.dispose();
    }
    this.busy = false;
  }
}
