// Where the table is not enough: the solver runs exactly what is shown. Asks for a token, follows the job, hands over
// the shape. The token stays in this page's memory.

import { follow, Problem, runExactly, stop, type Answer, type Asked, type Job } from "./api";
import { button, el } from "./dom";

/** Roughness' expected error above which a run is offered. */
const LARGE = 0.05;
/** Problems that a run gets around. */
const REFUSALS = ["too-uncertain", "outside-table"];

export class Exact {
  private readonly begin = button("Run exactly", () => this.want());
  private readonly halt = button("Stop", () => void this.cancel());
  private readonly bar = el("progress", { max: "1", value: "0", "aria-label": "Progress of the run" });
  private readonly said = el("span", { role: "status" });
  private readonly token = el("input", { type: "password", id: "token", autocomplete: "off", required: "" });
  private readonly dialog: HTMLDialogElement;
  private secret = "";
  private job: Job | undefined;

  constructor(
    private readonly root: HTMLElement,
    private readonly now: () => Asked,
    private readonly done: (answer: Answer, asked: Asked) => boolean,
  ) {
    const form = el(
      "form",
      { method: "dialog" },
      el("h2", {}, "Run exactly"),
      el("p", {}, "The solver computes this very shape, which takes from seconds to minutes. For that the service wants a token of the scope run:"),
      el("code", {}, "wizen token create --scopes run --name me"),
      el("label", { for: "token" }, "Token"),
      this.token,
      el("div", { class: "row" }, el("button", { type: "submit", class: "primary" }, "Run"), button("Cancel", () => this.dialog.close())),
    );
    this.dialog = el("dialog", { "aria-label": "Run exactly" }, form);
    form.addEventListener("submit", () => {
      this.secret = this.token.value.trim();
      this.token.value = "";
      void this.run();
    });
    root.replaceChildren(this.begin, this.halt, this.bar, this.said, this.dialog);
    root.hidden = true;
    this.running(false);
  }

  /** Offer a run where an answer is not to be trusted. */
  judge(about: Answer["about"]): void {
    const error = about.expected_error?.rgh;
    this.offer(!about.exact && (!about.inside || error === undefined || error >= LARGE));
  }

  /** Offer a run where the table refused. */
  refused(error: unknown): void {
    if (error instanceof Problem) this.offer(REFUSALS.includes(error.kind));
  }

  private offer(wanted: boolean): void {
    if (this.job) return;
    this.root.hidden = !wanted;
    if (wanted) this.say("");
  }

  private want(): void {
    if (this.secret) void this.run();
    else this.dialog.showModal();
  }

  private async run(): Promise<void> {
    const asked = this.now();
    this.say("Asking …");
    this.begin.disabled = true;
    try {
      let answer = await runExactly(asked, this.secret);
      if ("links" in answer) {
        this.job = answer;
        this.running(true);
        const ended = await follow(answer, (job) => this.progress(job));
        if (ended.state !== "done") {
          const { detail, advice } = ended.problem ?? { detail: "The run was stopped.", advice: "" };
          throw new Problem(detail, advice, "");
        }
        answer = (await runExactly(asked, this.secret)) as Answer;
      }
      this.end();
      const shown = this.done(answer, asked);
      this.say(shown ? "Computed for this very point." : "The run is done. Go back to where it was asked for, and run again: it is there at once.");
      this.root.hidden = false;
    } catch (error) {
      this.end();
      if (error instanceof Problem && error.status === 401) this.secret = ""; // asked for again
      this.say(error instanceof Problem ? error.message : String(error));
    }
  }

  private progress(job: Job): void {
    this.job = job;
    this.bar.value = job.progress.fraction;
    this.say(job.state === "running" ? `${Math.round(100 * job.progress.fraction)} % ${job.progress.message}` : "Waiting for its turn …");
  }

  private async cancel(): Promise<void> {
    if (!this.job) return;
    try {
      await stop(this.job, this.secret);
    } catch (error) {
      this.say(error instanceof Problem ? error.message : String(error));
    }
  }

  private end(): void {
    this.job = undefined;
    this.begin.disabled = false;
    this.running(false);
  }

  private running(on: boolean): void {
    this.begin.hidden = on;
    this.halt.hidden = this.bar.hidden = !on;
  }

  private say(text: string): void {
    this.said.textContent = text;
  }
}
