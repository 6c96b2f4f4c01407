// What the 3D view gets of the page: plain functions, as its script is another one, with no signals of its own.
import type { Frame } from "../../data/frames";
import type { ChannelHeader, RobotHeader, WorldThing } from "../../generated/view";
import type { ColourName } from "../../shell/theme";
import type { Bounds } from "../plan/camera";
import type { Place } from "../plan/poses";

export interface SceneTrack {
  readonly robot: RobotHeader;
  readonly frame: Frame;
  readonly at: Place;
  readonly colour: string | undefined;
  readonly ranges: readonly { readonly channel: ChannelHeader; readonly frame: Frame }[];
}

export interface SceneModel {
  readonly now: () => number;
  readonly bounds: () => Bounds;
  readonly things: () => readonly WorldThing[];
  readonly tracks: () => readonly SceneTrack[];
  readonly contacts: () => readonly { readonly x: number; readonly y: number }[];
  readonly colour: (name: ColourName) => string;
  readonly scale: (share: number) => string;
  readonly nearest: () => number;
  /** Calls back whenever something of this has changed, at most once a frame; returns how it ends. */
  readonly watch: (changed: () => void) => () => void;
}

export interface SceneHandle {
  readonly whole: () => void;
  readonly zoom: (factor: number) => void;
  readonly follow: (on: boolean) => void;
  readonly dispose: () => void;
}
