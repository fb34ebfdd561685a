// Keeping pace with a hand that does not rest: questions that outrun their answers, and words that nobody could read.

/** One question is under way, the newest waits, those in between are never asked; the next is asked before an answer is drawn. */
export class Latest<Question, Answer> {
  private waiting: Question | undefined;
  private busy = false;

  constructor(
    private readonly ask: (question: Question) => Promise<Answer>,
    private readonly answered: (answer: Answer, question: Question, last: boolean) => void,
    private readonly failed: (error: unknown, question: Question) => void,
  ) {}

  put(question: Question): void {
    this.waiting = question;
    if (!this.busy) void this.work();
  }

  private begin(): { question: Question; found: Promise<{ answer: Answer } | { error: unknown }> } | undefined {
    if (this.waiting === undefined) return undefined;
    const question = this.waiting;
    this.waiting = undefined;
    const found = this.ask(question).then(
      (answer) => ({ answer }),
      (error: unknown) => ({ error }),
    );
    return { question, found };
  }

  private async work(): Promise<void> {
    this.busy = true;
    for (let now = this.begin(); now; ) {
      const found = await now.found;
      const next = this.begin();
      if ("answer" in found) this.answered(found.answer, now.question, next === undefined);
      else this.failed(found.error, now.question);
      now = next ?? this.begin();
    }
    this.busy = false;
  }
}

/** Does something at once, but at most once in a while [ms], and then once more for what came last. */
export class Calm {
  private timer = 0;
  private last = -Infinity;

  constructor(private readonly rest = 150) {}

  do(what: () => void): void {
    clearTimeout(this.timer);
    const wait = this.last + this.rest - performance.now();
    if (wait > 0) this.timer = window.setTimeout(() => this.now(what), wait);
    else this.now(what);
  }

  stop(): void {
    clearTimeout(this.timer);
  }

  private now(what: () => void): void {
    this.last = performance.now();
    what();
  }
}
