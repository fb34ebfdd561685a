// The page: tabs, and the room that the address bar names. Each room is its own module, fetched when it is first opened.

import { fromHash, House, type Room, type Words } from "./house";
import { byId, el } from "./parts/dom";
import { token } from "./service/http";
import { solvers, type Entry } from "./service/solvers";
import { tables, type Table } from "./service/shapes";

const AGAIN = 3000; // [ms] until a silent service is asked again

const GALLERY = "gallery";
const SCENE = "scene";

/** What the tabs lead to. */
interface Offer {
  room: string;
  label: string;
  title: string;
}

const house = new House();
let close: () => void = () => undefined;
let turn = 0;

/** A token may come with the address that `wizen serve --studio` prints; it does not stay there. */
function takeToken(): void {
  const words = fromHash();
  if (!words.token) return;
  token.set(words.token);
  delete words.token;
  history.replaceState(null, "", `#${new URLSearchParams(words)}`);
}

/** The room that an address means: it names one, or it has a shape of a table, or it is the first that has tables. */
function meant(words: Words, entries: Entry[], all: Table[]): string {
  if (words.room) return words.room;
  const table = all.find((one) => one.name === words.table) ?? all.find((one) => !one.complaint);
  return table?.solver ?? entries[0].name;
}

const hasTables = (entry: Entry, all: Table[]): boolean => all.some((table) => table.solver === entry.name);

async function opened(room: string, words: Words, entries: Entry[], all: Table[]): Promise<Room> {
  if (room === GALLERY) return (await import("./rooms/gallery")).gallery(entries);
  if (room === SCENE) return (await import("./rooms/scene")).scene;
  if (words.live) return (await import("./rooms/live")).live(room);
  const own = all.filter((table) => table.solver === room || table.complaint);
  if (own.length && !words.run) return (await import("./rooms/table")).table(own);
  return (await import("./rooms/job")).job(room, own.length > 0);
}

function tabs(offers: Offer[], current: string): void {
  byId("rooms").replaceChildren(
    ...offers.map(({ room, label, title }) =>
      el("a", { href: `#room=${room}`, title, ...(room === current ? { "aria-current": "page" } : {}) }, label),
    ),
  );
  // not scrollIntoView: browsers go on from there with the next Tab, past the first rooms
  const [strip, chosen] = [byId("rooms"), byId("rooms").querySelector<HTMLElement>("[aria-current]")];
  if (chosen) strip.scrollLeft = chosen.offsetLeft - strip.offsetLeft - (strip.clientWidth - chosen.offsetWidth) / 2;
}

async function go(): Promise<void> {
  const mine = ++turn;
  takeToken();
  try {
    const words = fromHash();
    // most visitors come for a shape of a table: its room is fetched while the service is asked what there is
    if (!words.room) void import("./rooms/table").catch(() => undefined);
    const [every, all] = await Promise.all([solvers(), tables()]);
    // what can be seen at once goes before what has to be computed
    const entries = [...every].sort((a, b) => Number(hasTables(b, all)) - Number(hasTables(a, all)));
    const room = meant(words, entries, all);
    const offers = [
      { room: GALLERY, label: "Gallery", title: "What there is" },
      ...entries.map(({ name, title, advance }) => ({ room: name, label: advance, title })),
      { room: SCENE, label: "Scene", title: "Many shapes together" },
    ];
    if (mine !== turn) return;
    close();
    close = () => undefined;
    house.clear();
    tabs(offers, room);
    const open = await opened(room, words, entries, all);
    if (mine !== turn) return;
    const end = await open(house, words);
    if (mine !== turn) end();
    else close = end;
  } catch (error) {
    if (mine !== turn) return;
    house.complain(error);
    setTimeout(() => mine === turn && void go(), AGAIN);
  }
}

addEventListener("hashchange", () => void go());
void go();
