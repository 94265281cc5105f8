// history.js -- undo and redo. A part of an ES module (front_end.py).

const PAUSE_MS = 500; // between changes that are undone one by one
const MOST_UNDO = 200; // changes

/** The states before and after the one that is shown. */
class History {
  /** @param {View} view whose state it keeps */
  constructor(view) {
    this.view = view;
    /** @type {State[]} */
    this.past = [];
    this.future = [];
    this.last = -Infinity; // when the state changed
    this.isHeld = false; // a gesture goes on
  }

  listen(on) {
    const { view } = this;
    on(view.field("undo"), "click", () => this.go(this.past, this.future));
    on(view.field("redo"), "click", () => this.go(this.future, this.past));
    on(view.root, "pointerdown", () => { this.hold(true); }, { capture: true });
    for (const type of ["pointerup", "pointercancel"]) {
      on(view.root, type, () => this.hold(false), { capture: true });
    }
  }

  hold(isHeld) {
    this.isHeld = isHeld;
    this.last = -Infinity;
    this.isOpen = false; // what is done next is another change
  }

  /** The state is about to change. Its parts are never changed in place. */
  note() {
    const now = performance.now();
    const goesOn = this.isHeld ? this.isOpen : now - this.last < PAUSE_MS;
    this.last = now;
    if (goesOn) return;
    this.isOpen = true;
    this.past.push({ ...this.view.state });
    if (this.past.length > MOST_UNDO) this.past.shift();
    this.future = [];
  }

  go(from, to) {
    const { view } = this;
    const isSame = (other) => Object.keys(other).every((key) => other[key] === view.state[key]);
    let state = from.pop();
    while (state && isSame(state)) state = from.pop(); // what was done changed nothing
    if (!state) return this.show();
    to.push({ ...view.state });
    [this.past, this.future] = from === this.past ? [from, to] : [to, from];
    this.last = -Infinity;
    this.isOpen = false;
    Object.assign(view.state, state);
    view.resetDue = state.camera === null;
    view.clearNote("error");
    view.showState();
    view.push();
  }

  undo() {
    this.go(this.past, this.future);
  }

  redo() {
    this.go(this.future, this.past);
  }

  show() {
    this.view.field("undo").disabled = this.past.length === 0;
    this.view.field("redo").disabled = this.future.length === 0;
  }
}
