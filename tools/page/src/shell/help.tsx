// The list of keys and views.
import { useEffect, useRef } from "preact/hooks";
import { viewsOf } from "../views/all";
import type { App } from "./app";
import { IconButton } from "./icons";
import { KEYS } from "./keys";

const POINTER = [
  ["click in plots or wires", "go to that time; near an edge, to the edge"], ["Shift click, Ctrl click", "set cursor A, cursor B"], ["drag", "move the window, or the plan"],
  ["wheel", "closer or further: time over wires, metres over the plan"], ["Ctrl wheel over plots", "closer or further in time"], ["double click", "show all again"], ["Ctrl 1 … 9", "to a view"],
] as const;

export function Help({ app, onClose }: { app: App; onClose: () => void }) {
  const dialog = useRef<HTMLDialogElement>(null);
  useEffect(() => dialog.current?.showModal(), []);
  const views = viewsOf(app.store);
  return (
    <dialog ref={dialog} class="help" aria-labelledby="help-title" onClose={onClose}>
      <div class="help-head"><h2 id="help-title">Keys and views</h2><IconButton icon="close" label="Close" onClick={() => dialog.current?.close()} /></div>
      <table class="data"><tbody>
        {KEYS.filter((key) => key.keys).map((key) => <tr><th scope="row"><kbd>{key.keys}</kbd></th><td>{key.does}</td></tr>)}
        {POINTER.map(([keys, does]) => <tr><th scope="row"><kbd>{keys}</kbd></th><td>{does}</td></tr>)}
      </tbody></table>
      <table class="data"><tbody>{views.map((view) => <tr><th scope="row">{view.title}</th><td>{view.doc}</td></tr>)}</tbody></table>
    </dialog>
  );
}
