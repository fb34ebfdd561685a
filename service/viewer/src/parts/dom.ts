// Elements without templates: text stays text.

type Child = Node | string | undefined;

export function el<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  attributes: Record<string, string> = {},
  ...children: Child[]
): HTMLElementTagNameMap[K] {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  made.append(...children.filter((child) => child !== undefined));
  return made;
}

export function button(label: string, click: () => void, attributes: Record<string, string> = {}): HTMLButtonElement {
  const made = el("button", { type: "button", ...attributes }, label);
  made.addEventListener("click", click);
  return made;
}

/** Something that opens. */
export function details(label: string, open: boolean, ...children: Child[]): HTMLDetailsElement {
  const made = el("details", {}, el("summary", {}, label), ...children);
  made.open = open;
  return made;
}

/** A list of terms with what they are. */
export const terms = (rows: [string, string | Node][]): HTMLElement =>
  el("dl", {}, ...rows.flatMap(([name, value]) => [el("dt", {}, name), el("dd", {}, value)]));

/** A row of choices of which one holds. */
export function select(label: string, id: string, options: [string, string][], chosen: string, changed: (value: string) => void): HTMLElement {
  const made = el("select", { id }, ...options.map(([value, text]) => el("option", { value }, text)));
  made.value = chosen;
  made.addEventListener("change", () => changed(made.value));
  return el("div", { class: "field" }, el("label", { for: id }, label), made);
}

export const byId = <T extends HTMLElement>(id: string): T => document.getElementById(id) as T;

/** A number as people read it: four digits, no tail of zeros. */
export const digits = (value: number): string => String(Number(value.toPrecision(4)));

export const withUnits = (value: number, units: string): string => digits(value) + (units === "1" || !units ? "" : ` ${units}`);

/** "1 run", "8 runs". */
export const counted = (count: number, word = "run"): string => `${count} ${count === 1 ? word : `${word}s`}`;

/** A name of the service in words: "jujube1" is "jujube 1". */
export const worded = (name: string): string => name.replace(/([a-z])(\d)/g, "$1 $2").replace(/[-_]/g, " ");
