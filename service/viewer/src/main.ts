// The page: catalogue -> sliders -> questions -> mesh. Each part is its own module and knows nothing of the others.

import { Actions } from "./actions";
import {
  Problem,
  families as askFamilies,
  shape,
  solver as askSolver,
  tables as askTables,
  type Answer,
  type Asked,
  type Family,
  type Point,
  type Table,
} from "./api";
import { Choice, Slider } from "./controls";
import { Detail } from "./detail";
import { button, byId, el } from "./dom";
import { Exact } from "./exact";
import { counted, familyChoice, familyOf } from "./families";
import { Fruit } from "./fruit";
import { Latest } from "./live";
import { dressed } from "./looks";
import { Player } from "./play";
import { Studio } from "./scene";
import { at, clamp, fromHash, presetsIn, scales, shareOf, toHash, type Scale } from "./state";
import { showFacts, showTrust } from "./trust";

const REST = 160; // [ms] without a change after which the finest shape is asked for
const AGAIN = 3000; // [ms] until a silent service is asked again

interface Question extends Asked {
  moving: boolean;
}

/** Methods of look-up worth a button, in words; a table's default goes before them. */
const METHODS: Record<string, string> = { idw: "Paper's IDW", linear: "Linear", nearest: "Nearest run" };

const canvas = byId<HTMLCanvasElement>("view");
const problem = byId("problem");

function complain(error: unknown): void {
  const detail = error instanceof Problem ? error.detail : "This page met an error that it did not foresee.";
  const advice = error instanceof Problem ? error.advice : String(error);
  problem.replaceChildren(el("strong", {}, detail), " ", advice);
  problem.hidden = false;
}

async function start(): Promise<void> {
  const all = await askTables();
  const usable = all.filter((table) => !table.complaint);
  if (!usable.length) {
    throw new Problem(
      all[0]?.complaint ?? "There is no table yet.",
      "Run a sweep and `wizen table build`; this page shows it as soon as it is there.",
      "",
    );
  }
  const wanted = fromHash();
  const covered = await askFamilies();
  const family = familyOf(covered, wanted.preset);
  const first = [wanted.table ?? family?.name, "default", "sphere"].map((name) => usable.find((t) => t.name === name));
  const table = first.find((found) => found !== undefined) ?? usable[0];
  await page(table, covered, wanted);
}

async function page(table: Table, covered: Family[], wanted: Record<string, string>): Promise<void> {
  const solver = await askSolver(table.solver);
  const look = dressed(solver.looks);
  const axes = scales(table);
  const stage = axes[0];
  const point: Point = {};
  for (const scale of axes) {
    const given = wanted[scale.name] === undefined ? NaN : Number(wanted[scale.name]);
    point[scale.name] = Number.isFinite(given) ? clamp(scale, given) : at(scale, scale === stage ? 0.8 : 0.35);
  }
  const meant = presetsIn(table, solver)[wanted.preset ?? ""] ?? {};
  for (const [name, value] of Object.entries(meant)) if (wanted[name] === undefined) point[name] = value;
  const shades = Object.keys(look.shades);
  let skin = wanted.skin in look.shades ? wanted.skin : (shades.find((name) => table.name.startsWith(name)) ?? shades[0]);

  const fruit = new Fruit();
  const studio = new Studio(canvas, fruit);
  const detail = new Detail(table.max_resolution);
  const named: Record<string, string> = { Default: table.methods.default };
  for (const name of table.methods.known) if (name in METHODS) named[METHODS[name]] ??= name;
  let method = table.methods.known.includes(wanted.method) ? wanted.method : table.methods.default;
  const actions = new Actions(byId("actions"), () => ({ table, point, resolution: detail.finest, method }));
  let resting = 0;

  const display = (answer: Answer, at: Point, moving: boolean): void => {
    problem.hidden = true;
    fruit.wear(look.shades[skin], shareOf(stage, at[stage.name]));
    fruit.show(answer.points, answer.n, moving);
    studio.reshaped();
    const speed = `${answer.milliseconds.toFixed(0)} ms, ${(answer.bytes / 1024).toFixed(0)} kB`;
    showTrust(byId("trust"), answer.about, speed);
    showFacts(byId("facts").querySelector("div") as HTMLElement, answer.about);
    canvas.dataset.shown = JSON.stringify({ n: answer.n, ...at });
    canvas.dataset.method = answer.about.method;
    canvas.dataset.exact = String(answer.about.exact);
  };
  const exact = new Exact(
    byId("exact"),
    () => ({ table, point: { ...point }, resolution: detail.finest, method }),
    (answer, asked) => {
      // whoever has gone on meanwhile is not thrown back
      if (JSON.stringify(asked.point) !== JSON.stringify(point)) return false;
      display(answer, asked.point, false);
      return true;
    },
  );

  const questions = new Latest<Question, Answer>(
    (q) => shape(q),
    (answer, q, last) => {
      if (q.moving) detail.learn(q.resolution, answer.milliseconds);
      display(answer, q.point, q.moving);
      if (!q.moving) exact.judge(answer.about);
      if (last && q.moving) rest();
    },
    (error) => {
      complain(error);
      exact.refused(error);
      setTimeout(rest, AGAIN);
    },
  );
  const ask = (moving: boolean): void => {
    questions.put({ table, point: { ...point }, resolution: detail.of(moving), method, moving });
  };
  const rest = (): void => {
    clearTimeout(resting);
    resting = window.setTimeout(() => ask(false), REST);
  };
  const changed = (): void => {
    ask(true);
    rest();
    actions.refresh();
    keep();
  };
  const keep = (): void => {
    const words = new URLSearchParams({ table: table.name, skin });
    if (method !== table.methods.default) words.set("method", method);
    toHash(words, point);
  };

  const sliders = axes.map(
    (scale) =>
      new Slider(scale, look, (value) => {
        if (scale === stage) player.stop();
        places.mark(undefined);
        point[scale.name] = value;
        changed();
      }),
  );
  const set = (values: Point): void => {
    for (const slider of sliders) {
      const { name } = slider.scale;
      if (name in values) point[name] = clamp(slider.scale, values[name]);
      slider.set(point[name]);
    }
    changed();
  };

  const play = button(`▶ ${look.advance}`, () => player.toggle(shareOf(stage, point[stage.name])), {
    class: "play",
    "aria-label": look.advance,
  });
  const player = new Player(
    (share) => set({ [stage.name]: at(stage, share) }),
    (on) => {
      play.textContent = on ? "❚❚ Stop" : `▶ ${look.advance}`;
      play.setAttribute("aria-label", on ? "Stop" : look.advance);
    },
  );

  const presets = presetsIn(table, solver);
  const spots: Record<string, Point> = Object.fromEntries(
    Object.entries(look.places).map(([name, place]) => [name, { ...shares(axes, place.shares), [stage.name]: place.stage }]),
  );
  const places = new Choice("Looks", [...Object.keys(spots), ...Object.keys(presets)], (name) => {
    player.stop();
    set(spots[name] ?? presets[name]);
    places.mark(name);
  });
  const skins = new Choice(
    "Skin",
    Object.keys(look.shades),
    (name) => {
      skin = name;
      skins.mark(name);
      fruit.wear(look.shades[skin], shareOf(stage, point[stage.name]));
      studio.invalidate();
      keep();
    },
    (name, made) => {
      const swatch = el("i", { class: "swatch", "aria-hidden": "true" });
      swatch.style.setProperty("--fresh", look.shades[name].ridge[0]);
      swatch.style.setProperty("--dry", look.shades[name].ridge[1]);
      made.prepend(swatch);
    },
  );
  skins.mark(skin);
  const wayOf = (name: string): string | undefined => Object.keys(named).find((word) => named[word] === name);
  const ways = new Choice(
    "Look-up",
    Object.keys(named),
    (word) => {
      method = named[word];
      ways.mark(word);
      changed();
    },
    (word, made) => (made.title = named[word]),
  );
  ways.mark(wayOf(method));

  byId("subject").textContent = `${solver.title} · ${counted(table.samples)}`;
  byId("controls").replaceChildren(
    ...(covered.length > 1 ? [familyChoice(covered, table.name, visit)] : []),
    ...sliders.slice(0, 1).map((slider) => slider.root),
    el("div", { class: "row" }, play, button("Reset view", () => studio.home())),
    ...sliders.slice(1).map((slider) => slider.root),
    places.root,
    skins.root,
    ways.root,
  );
  set({});
}

const shares = (axes: Scale[], given: Record<string, number>): Point =>
  Object.fromEntries(axes.filter((axis) => axis.name in given).map((axis) => [axis.name, at(axis, given[axis.name])]));

/** Go to another family, to where its picture was taken. */
function visit(family: Family): void {
  const words = new URLSearchParams({ table: family.name });
  for (const [name, value] of Object.entries(family.portrait)) words.set(name, String(value));
  location.hash = words.toString();
  location.reload();
}

async function keepTrying(): Promise<void> {
  try {
    await start();
    problem.hidden = true;
  } catch (error) {
    complain(error);
    setTimeout(() => void keepTrying(), AGAIN);
  }
}

void keepTrying();
