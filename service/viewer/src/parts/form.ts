// A form out of a schema: every parameter with its unit, its range, and a sentence where a value is out of it.

import type { Parameters, Schema, Values } from "../service/solvers";
import { same } from "../service/solvers";
import { between, Course, type Point } from "./course";
import { button, details, digits, el } from "./dom";
import { MeshFile } from "./meshfile";

/** One value that can be edited. `get` throws what is wrong with it. */
interface Editor {
  root: HTMLElement;
  get(): unknown;
  set(value: unknown): void;
}

type Changed = () => void;
/** Stands for no word of a schema's. */
const OWN = "\u0000";
let numbered = 0;

const clone = <T>(value: T): T => (value === undefined ? value : JSON.parse(JSON.stringify(value)));

/** What a schema is, its reference looked up and `null` set aside. */
function resolved(schema: Schema, defs: Record<string, Schema>): { schema: Schema; optional: boolean } {
  const { $ref, ...own } = schema;
  if ($ref) return resolved({ ...defs[$ref.split("/").pop() as string], ...own }, defs);
  if (schema.anyOf) {
    const real = schema.anyOf.find((one) => one.type !== "null") as Schema;
    const optional = schema.anyOf.some((one) => one.type === "null");
    const { anyOf: _, ...rest } = schema;
    return { schema: resolved({ ...real, ...rest }, defs).schema, optional };
  }
  return { schema, optional: false };
}

/** "-10 to 60 degC", "more than 0", as the schema bounds it. */
function range(schema: Schema): string {
  const { minimum, maximum, exclusiveMinimum, exclusiveMaximum } = schema;
  const units = schema.units && schema.units !== "1" ? ` ${schema.units}` : "";
  const low = minimum ?? exclusiveMinimum;
  const high = maximum ?? exclusiveMaximum;
  if (low !== undefined && high !== undefined) return `${minimum === undefined ? "more than " : ""}${digits(low)} to ${digits(high)}${units}`;
  if (low !== undefined) return `${minimum === undefined ? "more than" : "at least"} ${digits(low)}${units}`;
  return high !== undefined ? `at most ${digits(high)}${units}` : "";
}

function outside(value: number, schema: Schema): boolean {
  const { minimum = -Infinity, maximum = Infinity, exclusiveMinimum = -Infinity, exclusiveMaximum = Infinity } = schema;
  return value < minimum || value > maximum || value <= exclusiveMinimum || value >= exclusiveMaximum;
}

const titled = (name: string): string => {
  const words = name.replace(/_/g, " ");
  return words.charAt(0).toUpperCase() + words.slice(1);
};

function numeric(schema: Schema, label: string, changed: Changed, id = `value-${numbered++}`): Editor {
  const input = el("input", { type: "text", inputmode: "decimal", id, "aria-label": label, autocomplete: "off" });
  const said = el("span", { class: "wrong", id: `${id}-wrong`, role: "status" });
  input.setAttribute("aria-describedby", said.id);
  const read = (): number => {
    const text = input.value.trim().replace(",", ".");
    const value = text === "" ? NaN : Number(text);
    if (!Number.isFinite(value)) throw new Error(`${label}: write a number.`);
    if (schema.type === "integer" && !Number.isInteger(value)) throw new Error(`${label}: write a whole number.`);
    if (outside(value, schema)) throw new Error(`${label}: ${digits(value)} is out of range, ${range(schema)}.`);
    return value;
  };
  const check = (): void => {
    let text = "";
    try {
      read();
    } catch (error) {
      text = (error as Error).message;
    }
    said.textContent = text;
    input.setAttribute("aria-invalid", String(text !== ""));
  };
  input.addEventListener("input", () => {
    check();
    changed();
  });
  return {
    root: el("span", { class: "number" }, input, said),
    get: read,
    set: (value) => {
      input.value = String(value ?? "");
      if (value !== undefined) check();
    },
  };
}

function choice(schema: Schema, label: string, changed: Changed): Editor {
  const input = el("select", { "aria-label": label }, ...(schema.enum ?? []).map((name) => el("option", { value: name }, name || "none")));
  input.addEventListener("change", changed);
  return { root: input, get: () => input.value, set: (value) => (input.value = String(value)) };
}

function flag(label: string, changed: Changed): Editor {
  const input = el("input", { type: "checkbox", "aria-label": label });
  input.addEventListener("change", changed);
  return { root: input, get: () => input.checked, set: (value) => (input.checked = Boolean(value)) };
}

function vector(schema: Schema, label: string, defs: Record<string, Schema>, changed: Changed): Editor {
  const own = (schema.prefixItems ?? []).map((one, i) => editor({ ...one, units: schema.units }, `${label} ${i + 1}`, defs, changed));
  return {
    root: el("span", { class: "vector" }, ...own.map((one) => one.root)),
    get: () => own.map((one) => one.get()),
    set: (value) => own.forEach((one, i) => one.set((value as unknown[] | undefined)?.[i])),
  };
}

/** What no other editor fits: as JSON. */
function json(label: string, changed: Changed): Editor {
  const input = el("textarea", { rows: "2", "aria-label": `${label}, as JSON`, spellcheck: "false" });
  input.addEventListener("input", changed);
  return {
    root: input,
    get: () => {
      try {
        return JSON.parse(input.value || "null");
      } catch {
        throw new Error(`${label}: this is no JSON.`);
      }
    },
    set: (value) => (input.value = value === undefined ? "" : JSON.stringify(value)),
  };
}

function record(schema: Schema, label: string, defs: Record<string, Schema>, changed: Changed): Editor {
  const own: Record<string, Editor> = {};
  const root = el("div", { class: "record", role: "group", "aria-label": label });
  for (const [name, one] of Object.entries(schema.properties ?? {})) {
    if (one.const !== undefined) continue;
    const { schema: found } = resolved(one, defs);
    const made = editor(one, titled(name), defs, changed);
    own[name] = made;
    made.set(clone(found.default));
    root.append(el("div", { class: "entry", title: found.description ?? "" }, el("span", {}, titled(name)), made.root));
  }
  const fixed = Object.entries(schema.properties ?? {}).filter(([, one]) => one.const !== undefined);
  return {
    root,
    get: () => ({ ...Object.fromEntries(fixed.map(([name, one]) => [name, one.const])), ...Object.fromEntries(Object.entries(own).map(([name, one]) => [name, one.get()])) }),
    set: (value) => {
      for (const [name, given] of Object.entries((value as Values | undefined) ?? {})) own[name]?.set(clone(given));
    },
  };
}

/** One of several kinds, each with parameters of its own. */
function union(schema: Schema, label: string, defs: Record<string, Schema>, changed: Changed): Editor {
  const { propertyName, mapping } = schema.discriminator as { propertyName: string; mapping: Record<string, string> };
  const kinds = Object.keys(mapping);
  const pick = el("select", { "aria-label": `${label}: ${propertyName}` }, ...kinds.map((name) => el("option", { value: name }, name)));
  const root = el("div", { class: "union" }, pick);
  let own: Editor;
  const take = (kind: string): void => {
    own = record(resolved({ $ref: mapping[kind] }, defs).schema, label, defs, changed);
    root.replaceChildren(pick, own.root);
  };
  take(kinds[0]);
  pick.addEventListener("change", () => {
    take(pick.value);
    changed();
  });
  return {
    root,
    get: () => ({ ...(own.get() as Values), [propertyName]: pick.value }),
    set: (value) => {
      const kind = String((value as Values | undefined)?.[propertyName] ?? kinds[0]);
      pick.value = kind;
      take(kind);
      own.set(value);
    },
  };
}

function list(schema: Schema, label: string, defs: Record<string, Schema>, changed: Changed, next?: () => unknown): Editor & { add(value?: unknown): void } {
  const rows = el("div", { class: "rows" });
  const own: { root: HTMLElement; editor: Editor }[] = [];
  const one = schema.items as Schema;
  const put = (value?: unknown): void => {
    const made = editor(one, `${label} ${own.length + 1}`, defs, changed);
    if (value !== undefined) made.set(value);
    const row = { editor: made, root: el("div", { class: "item" }) };
    const out = button("Remove", () => {
      own.splice(own.indexOf(row), 1);
      row.root.remove();
      changed();
    }, { "aria-label": `Remove ${label} ${own.length + 1}` });
    row.root.append(made.root, out);
    own.push(row);
    rows.append(row.root);
  };
  const more = button("Add", () => {
    put(next?.());
    changed();
  }, { "aria-label": `Add to ${label}` });
  return {
    root: el("div", { class: "list" }, rows, more),
    get: () => own.map((row) => row.editor.get()),
    set: (value) => {
      own.length = 0;
      rows.replaceChildren();
      for (const given of (value as unknown[] | undefined) ?? []) put(given);
    },
    add: (value) => {
      put(value);
      changed();
    },
  };
}

/** A list whose entries follow each other along one of their numbers: curves above the numbers. */
function course(schema: Schema, label: string, defs: Record<string, Schema>, changed: Changed, start: () => Point): ReturnType<typeof list> {
  const along = schema.along as string;
  const item = resolved(schema.items as Schema, defs).schema;
  const read = (): Point[] => rows.get() as Point[];
  const told = (): void => {
    try {
      curves.show(read());
    } catch {
      // said beside the number
    }
    changed();
  };
  const rows = list(schema, label, defs, told, () => {
    const points = read();
    const last = points[points.length - 1];
    const { maximum = Infinity, minimum = 0 } = (item.properties ?? {})[along];
    return between(points, along, last ? Math.min(maximum, last[along] + 1) : minimum, start());
  });
  const curves = new Course(item, along, start, (points) => {
    rows.set(points);
    changed();
  });
  const hint = el("p", { class: "hint" }, "Click to add a point, drag it, or move it by arrow keys; Delete takes it away.");
  return {
    root: el("div", {}, hint, curves.root, details("As numbers", false, rows.root)),
    get: rows.get,
    set: (value) => {
      rows.set(value);
      curves.show((value as Point[] | undefined) ?? []);
    },
    add: rows.add,
  };
}

function optional(inner: Editor, label: string, changed: Changed): Editor {
  const on = el("input", { type: "checkbox", "aria-label": `${label}: set` });
  const show = (): void => void (inner.root.hidden = !on.checked);
  on.addEventListener("change", () => {
    show();
    changed();
  });
  show();
  return {
    root: el("div", { class: "optional" }, on, inner.root),
    get: () => (on.checked ? inner.get() : null),
    set: (value) => {
      on.checked = value !== null && value !== undefined;
      if (on.checked) inner.set(value);
      show();
    },
  };
}

/** A word, or a value of one's own. */
function either(words: string[], inner: Editor, label: string, changed: Changed): Editor {
  const pick = el("select", { "aria-label": `${label}: which` }, ...words.map((word) => el("option", { value: word }, word)), el("option", { value: OWN }, "as written"));
  const show = (): void => void (inner.root.hidden = pick.value !== OWN);
  pick.addEventListener("change", () => {
    show();
    changed();
  });
  show();
  return {
    root: el("div", { class: "either" }, pick, inner.root),
    get: () => (pick.value === OWN ? inner.get() : pick.value),
    set: (value) => {
      pick.value = words.includes(value as string) ? (value as string) : OWN;
      if (pick.value === OWN) inner.set(value);
      show();
    },
  };
}

function editor(given: Schema, label: string, defs: Record<string, Schema>, changed: Changed): Editor {
  const words = (given.anyOf ?? []).flatMap((one) => (typeof one.const === "string" ? [one.const] : []));
  if (words.length && given.anyOf) {
    const rest = given.anyOf.filter((one) => one.const === undefined);
    if (rest.length) return either(words, editor({ ...given, anyOf: rest }, label, defs, changed), label, changed);
  }
  const { schema, optional: may } = resolved(given, defs);
  if (hasMesh(schema)) return new MeshFile(label, changed);
  const made = plain(schema, label, defs, changed);
  return may ? optional(made, label, changed) : made;
}

function plain(schema: Schema, label: string, defs: Record<string, Schema>, changed: Changed): Editor {
  if (schema.enum) return choice(schema, label, changed);
  if (schema.type === "number" || schema.type === "integer") return numeric(schema, label, changed);
  if (schema.type === "boolean") return flag(label, changed);
  if (schema.discriminator) return union(schema, label, defs, changed);
  if (schema.prefixItems && schema.prefixItems.length <= 8) return vector(schema, label, defs, changed);
  if (schema.type === "array" && schema.items && isList(schema.items, defs)) return list(schema, label, defs, changed);
  if (schema.type === "object" && schema.properties && !hasMesh(schema)) return record(schema, label, defs, changed);
  return json(label, changed);
}

const isList = (items: Schema, defs: Record<string, Schema>): boolean => {
  const { schema } = resolved(items, defs);
  return schema.discriminator !== undefined || schema.properties !== undefined || schema.prefixItems !== undefined;
};

/** Points and triangles are a matter for a file. */
const hasMesh = (schema: Schema): boolean => Object.keys(schema.properties ?? {}).some((name) => ["vertices", "faces", "triangles"].includes(name));

interface Field {
  name: string;
  editor: Editor;
  wrong: HTMLElement;
  summary?: HTMLElement;
  list?: { add(value?: unknown): void };
}

/** All parameters of a solver: those that matter first, lists that open, and the rest behind one door. */
export class Form {
  readonly root = el("div", { class: "form" });
  private readonly fields: Field[] = [];
  private readonly defs: Record<string, Schema>;

  constructor(
    private readonly schema: Parameters,
    first: Set<string>,
    private readonly changed: Changed,
  ) {
    this.defs = schema.$defs ?? {};
    const [main, lists, rest]: HTMLElement[][] = [[], [], []];
    for (const [name, given] of Object.entries(schema.properties)) {
      const { schema: found } = resolved(given, this.defs);
      const entries = found.type === "array" && found.items && isList(found.items, this.defs);
      const made = this.field(name, given, Boolean(entries));
      (entries || hasMesh(found) ? lists : first.has(name) && found.type !== "object" ? main : rest).push(made);
    }
    this.root.append(...main, ...lists, ...(rest.length ? [details(`More parameters (${rest.length})`, false, ...rest)] : []));
  }

  /** Show these values over the solver's defaults. */
  set(values: Values): void {
    for (const { name, editor: one } of this.fields) one.set(clone(name in values ? values[name] : this.default(name)));
    this.count();
    this.blame([]);
  }

  /** What differs from `base` and the defaults; throws a sentence where something is out of range. */
  values(base: Values = {}): Values {
    const found: Values = {};
    for (const { name, editor: one } of this.fields) {
      const value = one.get();
      if (!same(value, name in base ? base[name] : this.default(name))) found[name] = value;
    }
    return found;
  }

  /** Put the service's own complaints beside what they are about; returns those about nothing here. */
  blame(errors: { name: string; detail: string; advice: string }[]): void {
    for (const field of this.fields) {
      const own = errors.filter(({ name }) => name.split(/[.[]/)[0] === field.name || name === `params.${field.name}`);
      field.wrong.textContent = own.map(({ detail, advice }) => `${detail}. ${advice}`).join(" ");
    }
  }

  /** Add to the lists whose entries have all these names: where a click on the shape may go. */
  takers(...names: string[]): { name: string; add(value: Values): void }[] {
    return this.fields
      .filter(({ name, list: one }) => {
        const items = this.schema.properties[name].items;
        return one && items && names.every((wanted) => resolved(items, this.defs).schema.properties?.[wanted]);
      })
      .map(({ name, list: one }) => ({ name, add: (value) => one?.add(value) }));
  }

  private default(name: string): unknown {
    return this.schema.properties[name].default;
  }

  private field(name: string, given: Schema, isOpen: boolean): HTMLElement {
    const label = titled(name);
    const { schema: found } = resolved(given, this.defs);
    const changed = (): void => {
      this.count();
      this.changed();
    };
    const made = found.along ? course(found, label, this.defs, changed, () => this.steady(found)) : editor(given, label, this.defs, changed);
    const wrong = el("p", { class: "wrong", role: "status" });
    const about = [found.description, range(found)].filter(Boolean).join("; ");
    const field: Field = { name, editor: made, wrong };
    this.fields.push(field);
    const units = found.units && found.units !== "1" ? el("small", {}, found.units) : undefined;
    const open = isOpen || found.type === "object" || found.prefixItems !== undefined;
    if (!open) {
      return el("div", { class: "entry", title: about }, el("span", {}, label, " ", units), made.root, wrong);
    }
    if (isOpen && "add" in made) field.list = made as unknown as { add(value?: unknown): void };
    const opened = details(label, false, el("p", { class: "hint" }, about), made.root, wrong);
    field.summary = opened.querySelector("summary") as HTMLElement;
    return opened;
  }

  /** What holds where a course says nothing: the parameters of the same names, else the middle of what may be. */
  private steady(list: Schema): Point {
    const { properties = {} } = resolved(list.items as Schema, this.defs).schema;
    const value = (name: string): number => {
      try {
        const own = this.fields.find((field) => field.name === name)?.editor.get();
        if (typeof own === "number") return own;
      } catch {
        // said beside it
      }
      const { minimum = 0, maximum = 1 } = properties[name];
      return (minimum + maximum) / 2;
    };
    return Object.fromEntries(Object.keys(properties).map((name) => [name, value(name)]));
  }

  private count(): void {
    for (const { name, editor: one, summary, list: own } of this.fields) {
      if (!summary || !own) continue;
      try {
        summary.textContent = `${titled(name)} (${(one.get() as unknown[]).length})`;
      } catch {
        summary.textContent = `${titled(name)} (!)`;
      }
    }
  }
}
