// What people take away: a file, a command line, a link.

import { address, type Asked } from "./api";
import { button, el } from "./dom";

export class Actions {
  private readonly glb = el("a", { class: "button primary", download: "" }, "Download GLB");
  private readonly note = el("span", { role: "status" });

  constructor(
    root: HTMLElement,
    private readonly now: () => Asked,
  ) {
    root.replaceChildren(
      this.glb,
      button("Copy as curl", () => void this.copy(this.curl(), "Command copied.")),
      button("Copy link", () => void this.copy(location.href, "Link copied.")),
      this.note,
    );
  }

  refresh(): void {
    this.glb.href = this.url("glb");
  }

  private url(format: string): string {
    return new URL(address(this.now(), format), document.baseURI).href;
  }

  private curl(): string {
    return `curl '${this.url("glb")}' -o ${this.now().table.solver}.glb`;
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
