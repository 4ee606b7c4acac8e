// Moves the view with mouse, fingers and keys.

const ZOOM_PER_PIXEL = 0.0015;
const KEY_STEP = 24;
const KEY_ZOOM = 1.15;

/** Lets the user move the view of `element`'s canvas. `view` has orbit, pan, zoomAt, face and toggle. */
export function followPointer(canvas, view) {
  const pointers = new Map();
  const edge = () => Math.min(canvas.clientWidth, canvas.clientHeight);
  const fromMiddle = (x, y) => {
    const box = canvas.getBoundingClientRect();
    return [x - box.left - box.width / 2, y - box.top - box.height / 2];
  };
  const middleAndSpread = () => {
    const [a, b] = [...pointers.values()];
    return { x: (a.x + b.x) / 2, y: (a.y + b.y) / 2, spread: Math.hypot(a.x - b.x, a.y - b.y) };
  };

  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, { x: event.clientX, y: event.clientY, pans: event.button !== 0 || event.shiftKey });
  });
  canvas.addEventListener("pointermove", (event) => {
    const pointer = pointers.get(event.pointerId);
    if (!pointer) return;
    if (pointers.size === 2) {
      const before = middleAndSpread();
      [pointer.x, pointer.y] = [event.clientX, event.clientY];
      const now = middleAndSpread();
      if (before.spread > 0) view.zoomAt(now.spread / before.spread, ...fromMiddle(now.x, now.y), edge());
      view.pan(now.x - before.x, now.y - before.y, edge());
      return;
    }
    const [dx, dy] = [event.clientX - pointer.x, event.clientY - pointer.y];
    [pointer.x, pointer.y] = [event.clientX, event.clientY];
    if (pointer.pans) view.pan(dx, dy, edge());
    else view.orbit(dx, dy);
  });
  for (const end of ["pointerup", "pointercancel"]) {
    canvas.addEventListener(end, (event) => pointers.delete(event.pointerId));
  }
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("dblclick", () => view.face());
  // With Ctrl a trackpad's pinch; without it the page scrolls unless the canvas has the focus.
  canvas.addEventListener("wheel", (event) => {
    if (!event.ctrlKey && canvas.getRootNode().activeElement !== canvas) return;
    event.preventDefault();
    const lines = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? 16 : 1;
    const factor = Math.exp(-event.deltaY * lines * ZOOM_PER_PIXEL * (event.ctrlKey ? 6 : 1));
    view.zoomAt(factor, ...fromMiddle(event.clientX, event.clientY), edge());
  }, { passive: false });
  const keys = {
    ArrowLeft: () => view.orbit(KEY_STEP, 0),
    ArrowRight: () => view.orbit(-KEY_STEP, 0),
    ArrowUp: () => view.orbit(0, KEY_STEP),
    ArrowDown: () => view.orbit(0, -KEY_STEP),
    "+": () => view.zoomAt(KEY_ZOOM, 0, 0, edge()),
    "=": () => view.zoomAt(KEY_ZOOM, 0, 0, edge()),
    "-": () => view.zoomAt(1 / KEY_ZOOM, 0, 0, edge()),
    Home: () => view.face(),
    " ": () => view.toggle(),
  };
  canvas.addEventListener("keydown", (event) => {
    const act = event.ctrlKey || event.metaKey || event.altKey ? null : keys[event.key];
    if (!act) return;
    event.preventDefault();
    act();
  });
}
