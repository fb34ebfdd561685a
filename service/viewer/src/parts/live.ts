// Questions that outrun their answers: one is under way, the newest waits, those in between are never asked.

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

  private async work(): Promise<void> {
    this.busy = true;
    while (this.waiting !== undefined) {
      const question = this.waiting;
      this.waiting = undefined;
      try {
        const answer = await this.ask(question);
        this.answered(answer, question, this.waiting === undefined);
      } catch (error) {
        this.failed(error, question);
      }
    }
    this.busy = false;
  }
}
