// The element's own style.

export const STYLE = `
:host { display: block; position: relative; width: 100%; height: 480px; overflow: hidden; contain: content;
  font: 14px/1.4 system-ui, sans-serif; color: inherit; }
:host([hidden]) { display: none; }
canvas { display: block; width: 100%; height: 100%; touch-action: none; cursor: grab;
  background: center / contain no-repeat; }
canvas:active { cursor: grabbing; }
canvas:focus { outline: none; }
canvas:focus-visible { outline: 2px solid Highlight; outline-offset: -2px; }
.message { position: absolute; inset: auto 0 0 0; padding: .5em .8em; pointer-events: none; text-align: center; }
.message:empty { display: none; }
.message:not(:empty) { background: color-mix(in srgb, Canvas 85%, transparent); color: CanvasText; }
:host(.failed) .controls { display: none; }
.controls { position: absolute; top: 8px; right: 8px; width: 15em; max-width: calc(100% - 16px);
  max-height: calc(100% - 16px); overflow: auto; box-sizing: border-box; border-radius: 6px; padding: .3em .8em;
  background: color-mix(in srgb, Canvas 88%, transparent); color: CanvasText; }
.controls summary { cursor: pointer; padding: .2em 0; }
.controls label { display: grid; grid-template-columns: 5.5em 1fr; align-items: center; gap: .5em; margin: .35em 0; }
.controls select, .controls input, .controls button { font: inherit; min-width: 0; max-width: 100%; }
.controls input[type=range] { width: 100%; margin: 0; }
.controls .row { display: flex; gap: .5em; align-items: center; margin: .35em 0; }
.controls .row[hidden] { display: none; }
.controls .row input { flex: 1; }
.controls .joints { margin-left: .3em; }
.controls .note { margin: .35em 0; }
.controls .note:empty { display: none; }
`;
