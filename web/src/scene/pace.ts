/** How much of the scene is drawn while the view is turned: less where the machine does not keep up, all of it at rest. */

/** Everything; half the pixels each way; these and the coarse ground. */
export type Effort = 0 | 1 | 2;

/** Slower than 25 frames a second, so often in a row, and less is drawn. */
const SLOW_MS = 40;
const PATIENCE = 2;
/** A whole turn quicker than this, and the next one begins with more. */
const QUICK_MS = 18;

export class Pace {
  effort: Effort;
  private last = 0;
  private slow = 0;
  private frames = 0;
  private began = 0;

  /** Where the graphics are computed by the processor the least is drawn to begin with. */
  constructor(software = false) {
    this.effort = software ? 2 : 0;
  }

  /** The view begins to be turned. */
  begin(now: number): void {
    const mean = this.frames > 20 ? (this.last - this.began) / this.frames : Number.POSITIVE_INFINITY;
    if (mean < QUICK_MS && this.effort > 0) this.effort = (this.effort - 1) as Effort;
    this.began = this.last = now;
    this.frames = this.slow = 0;
  }

  /** A frame was begun while it is turned; whether less is drawn from now on. A pause does not count as slow. */
  frame(now: number): boolean {
    const took = now - this.last;
    this.last = now;
    this.frames += 1;
    this.slow = took > SLOW_MS && took < 1000 ? this.slow + 1 : 0;
    if (this.slow < PATIENCE || this.effort === 2) return false;
    this.effort = (this.effort + 1) as Effort;
    this.slow = 0;
    return true;
  }
}
