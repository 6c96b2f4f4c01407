// The 3D view's place: what draws it, with three, is loaded when it is opened.
import { effect, signal } from "@preact/signals";
import { render } from "preact";
import { unpacked } from "../../data/inline";
import type { App, ViewKind } from "../../shell/app";
import { IconButton } from "../../shell/icons";
import { scaleColour, theme } from "../../shell/theme";
import { thingsAt } from "../plan/things";
import { boundsOf, contactsAt, nearest, tracksAt } from "../plan/tracks";
import type { SceneHandle, SceneModel } from "./model";
import { reads } from "../../time/reads";

/** What the second script leaves for the first. */
declare global {
  interface Window {
    p2osScene?: (model: SceneModel, host: HTMLElement) => SceneHandle;
  }
}

export const scene: ViewKind = {
  id: "scene", title: "3D", doc: "The world in three dimensions; the camera turns, comes closer, and follows.",
  has: (store) => store.header.value.world !== null || store.channels("pose").length > 0,
  mount: (app, host) => {
    const said = signal("Loading the 3D view …"), handle = signal<SceneHandle | null>(null), follows = signal(false), bar = document.createElement("div");
    bar.className = "view-bar";
    host.append(bar);
    render(<Bar said={said} handle={handle} follows={follows} />, bar);
    let isGone = false;
    loaded ??= load();
    loaded.then(() => {
      if (isGone) return;
      handle.value = window.p2osScene!(modelOf(app), host);
      said.value = "";
    }).catch((error: unknown) => { said.value = error instanceof Error ? error.message : String(error); });
    return () => {
      isGone = true;
      handle.value?.dispose();
      render(null, bar);
    };
  },
};

function modelOf(app: App): SceneModel {
  const { store, clock } = app;
  return {
    now: () => clock.now.peek(),
    bounds: () => boundsOf(store),
    things: () => thingsAt(store, clock.now.peek()),
    tracks: () => tracksAt(store, clock.now.peek()),
    contacts: () => contactsAt(store, clock.now.peek()),
    colour: (name) => theme.peek()[name],
    scale: scaleColour,
    nearest: () => nearest(store),
    watch: (changed) => effect(() => {
      reads(store.version.value, store.header.value, clock.now.value, theme.value);
      changed();
    }),
  };
}

let loaded: Promise<void> | undefined;

/** Runs the second script: that in the page, packed, or the server's. */
async function load(): Promise<void> {
  const block = document.getElementById("scene"), script = document.createElement("script");
  if (block) {
    script.textContent = new TextDecoder().decode(await unpacked(block.textContent.trim()));
    document.head.append(script);
  } else if (document.getElementById("header")) throw new Error("3D is not in this page.");
  else await new Promise<void>((resolve, reject) => {
    script.onload = () => resolve();
    script.onerror = () => reject(new Error("The 3D view could not be loaded."));
    script.src = "bundle/scene.js";
    document.head.append(script);
  });
  if (!window.p2osScene) throw new Error("The 3D view could not be started.");
}

interface BarProps {
  readonly said: { value: string };
  readonly handle: { value: SceneHandle | null };
  readonly follows: { value: boolean };
}

function Bar({ said, handle, follows }: BarProps) {
  const { value } = handle;
  if (!value) return <p role="status" class="said">{said.value}</p>;
  return (
    <>
      <IconButton icon="whole" label="Show the whole world" onClick={() => value.whole()} />
      <IconButton icon="closer" label="Closer" onClick={() => value.zoom(1.25)} />
      <IconButton icon="further" label="Further away" onClick={() => value.zoom(0.8)} />
      <IconButton icon="follow" label="Follow the robot" pressed={follows.value} onClick={() => {
        follows.value = !follows.value;
        value.follow(follows.value);
      }} />
    </>
  );
}
