// What people take away: files, commands, a link.

import { kept } from "../house";
import { button, el } from "./dom";

/** A file by its address, and a command that makes it. */
export interface Take {
  files: { label: string; href: string; primary?: boolean; name?: string }[];
  commands: { label: string; text: string }[];
}

export class Actions {
  readonly root = el("section", { id: "actions", "aria-label": "Take it with you" });
  private readonly row = el("div", { class: "row" });
  private readonly note = el("p", { role: "status", class: "note" });
  private readonly lines = el("div", { class: "lines" });

  constructor(private readonly now: () => Take) {
    this.root.append(this.row, this.note, this.lines);
  }

  refresh(): void {
    const { files, commands } = this.now();
    this.row.replaceChildren(
      ...files.map(({ label, href, primary, name }) => el("a", { class: primary ? "button primary" : "button", href, download: name ?? "" }, label)),
      ...commands.map(({ label, text }) => button(`Copy as ${label}`, () => void this.copy(text, "Command copied."))),
      button("Copy link", () => {
        kept();
        void this.copy(location.href, "Link copied.");
      }),
    );
    const [first] = commands;
    this.lines.replaceChildren(...(first ? [el("code", { tabindex: "0", role: "note", "aria-label": `As ${first.label}` }, first.text)] : []));
  }

  private async copy(text: string, done: string): Promise<void> {
    try {
      await navigator.clipboard.writeText(text);
      this.note.textContent = done;
    } catch {
      // without HTTPS only this machine may use the clipboard: show what there was to copy
      this.note.replaceChildren(el("code", {}, text));
    }
    setTimeout(() => {
      if (this.note.textContent === done) this.note.textContent = "";
    }, 2500);
  }
}
