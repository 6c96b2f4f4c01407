// Made by tools/generators/page_types.py of channels.py, header.py, run_control.py (p2os/view): do not edit.

export const FORMAT = 1;
export const WHOLE_PIXELS = 2400;
export const FLAGS = { REDUCED: 1, REPLACES: 2 } as const;
export type Cells = "i64" | "f64" | "f32" | "u32" | "u8" | "text" | "bytes";
export interface ColumnKind {
  readonly name: string;
  readonly cells: Cells;
  readonly isWide: boolean;
}

export interface ChannelKind {
  readonly name: string;
  readonly number: number;
  readonly columns: readonly ColumnKind[];
}

/** a digital wire, or a bus of up to 32: what it has from then on */
export interface LevelsColumns {
  /** when, ns since the start */
  readonly t_ns: BigInt64Array;
  /** the value */
  readonly level: Uint32Array;
  /** how many changes the row stands for; more than 1 where changes are left out */
  readonly edges: Uint32Array;
}

/** a wave on the wire that the header's `of` names, while which its level says nothing */
export interface WavesColumns {
  /** when, ns since the start */
  readonly t_ns: BigInt64Array;
  /** ns between rises; 0 ends the wave */
  readonly period_ns: Float64Array;
  /** ns at level 1 of each period */
  readonly high_ns: Float64Array;
  /** ns since its last rise */
  readonly phase_ns: Float64Array;
}

/** a number over time: analog, or anything measured */
export interface SamplesColumns {
  /** when, ns since the start */
  readonly t_ns: BigInt64Array;
  /** in the channel's unit; NaN where there is none */
  readonly value: Float64Array;
}

/** where a robot is: x to the right, y up, heading counter-clockwise from x */
export interface PoseColumns {
  /** when, ns since the start */
  readonly t_ns: BigInt64Array;
  /** metres */
  readonly x_m: Float32Array;
  /** metres */
  readonly y_m: Float32Array;
  /** metres above the floor */
  readonly z_m: Float32Array;
  /** radians */
  readonly heading_rad: Float32Array;
  /** radians, nose up positive */
  readonly pitch_rad: Float32Array;
}

/** what range sensors read; their places are in the header's `sensors` */
export interface RangesColumns {
  /** when, ns since the start */
  readonly t_ns: BigInt64Array;
  /** metres, a cell a sensor; NaN where there is no echo */
  readonly range_m: Float32Array;
}

/** frames of a protocol */
export interface PacketsColumns {
  /** when, ns since the start */
  readonly t_ns: BigInt64Array;
  /** 1 from the client to the robot, 0 back, 2 unknown */
  readonly to_robot: Uint8Array;
  /** as on the wire */
  readonly data: readonly Uint8Array[];
  /** in the manual's words */
  readonly name: readonly string[];
  /** what it says, in a line */
  readonly says: readonly string[];
  /** JSON: [[first byte, byte after the last, name, meaning], …]; empty where left out */
  readonly fields: readonly string[];
  /** 1 where it is no sound frame */
  readonly is_bad: Uint8Array;
}

/** lines of a console */
export interface TextColumns {
  /** when, ns since the start */
  readonly t_ns: BigInt64Array;
  /** 0 printed by the firmware, 1 typed to it */
  readonly is_sent: Uint8Array;
  /** without its line end */
  readonly text: readonly string[];
}

/** what happened */
export interface EventsColumns {
  /** when, ns since the start */
  readonly t_ns: BigInt64Array;
  /** 0 debug, 1 information, 2 warning, 3 error */
  readonly severity: Uint8Array;
  /** which part says it */
  readonly who: readonly string[];
  /** a word */
  readonly what: readonly string[];
  /** a line */
  readonly detail: readonly string[];
  /** where, metres; NaN: nowhere */
  readonly x_m: Float32Array;
  /** metres */
  readonly y_m: Float32Array;
}

/** a goal: how it stands, and by how much */
export interface GoalColumns {
  /** when, ns since the start */
  readonly t_ns: BigInt64Array;
  /** 0 open, 1 met, 2 missed, 3 not judged */
  readonly standing: Uint8Array;
  /** in the channel's unit, negative where missed; NaN: unknown */
  readonly margin: Float64Array;
  /** why, in a line */
  readonly says: readonly string[];
}

/** a state machine: its states and transitions are in the header */
export interface StateColumns {
  /** when, ns since the start */
  readonly t_ns: BigInt64Array;
  /** place in the header's `states` */
  readonly state: Uint32Array;
  /** of the transition */
  readonly cause: readonly string[];
}

/** which line of the program runs */
export interface SourceColumns {
  /** when, ns since the start */
  readonly t_ns: BigInt64Array;
  /** as the debug information has it */
  readonly file: readonly string[];
  /** from 1 */
  readonly line: Uint32Array;
}

/** what is placed in the world, moved and removed */
export interface ThingsColumns {
  /** when, ns since the start */
  readonly t_ns: BigInt64Array;
  /** place in the world's `things` */
  readonly thing: Uint32Array;
  /** 0 from now on it is not */
  readonly is_there: Uint8Array;
  /** of its middle, metres */
  readonly x_m: Float32Array;
  /** metres */
  readonly y_m: Float32Array;
  /** radians */
  readonly heading_rad: Float32Array;
}

export const KINDS: readonly ChannelKind[] = [
  { name: "levels", number: 1, columns: [{ name: "t_ns", cells: "i64", isWide: false }, { name: "level", cells: "u32", isWide: false }, { name: "edges", cells: "u32", isWide: false }] },
  { name: "waves", number: 2, columns: [{ name: "t_ns", cells: "i64", isWide: false }, { name: "period_ns", cells: "f64", isWide: false }, { name: "high_ns", cells: "f64", isWide: false }, { name: "phase_ns", cells: "f64", isWide: false }] },
  { name: "samples", number: 3, columns: [{ name: "t_ns", cells: "i64", isWide: false }, { name: "value", cells: "f64", isWide: false }] },
  { name: "pose", number: 4, columns: [{ name: "t_ns", cells: "i64", isWide: false }, { name: "x_m", cells: "f32", isWide: false }, { name: "y_m", cells: "f32", isWide: false }, { name: "z_m", cells: "f32", isWide: false }, { name: "heading_rad", cells: "f32", isWide: false }, { name: "pitch_rad", cells: "f32", isWide: false }] },
  { name: "ranges", number: 5, columns: [{ name: "t_ns", cells: "i64", isWide: false }, { name: "range_m", cells: "f32", isWide: true }] },
  { name: "packets", number: 6, columns: [{ name: "t_ns", cells: "i64", isWide: false }, { name: "to_robot", cells: "u8", isWide: false }, { name: "data", cells: "bytes", isWide: false }, { name: "name", cells: "text", isWide: false }, { name: "says", cells: "text", isWide: false }, { name: "fields", cells: "text", isWide: false }, { name: "is_bad", cells: "u8", isWide: false }] },
  { name: "text", number: 7, columns: [{ name: "t_ns", cells: "i64", isWide: false }, { name: "is_sent", cells: "u8", isWide: false }, { name: "text", cells: "text", isWide: false }] },
  { name: "events", number: 8, columns: [{ name: "t_ns", cells: "i64", isWide: false }, { name: "severity", cells: "u8", isWide: false }, { name: "who", cells: "text", isWide: false }, { name: "what", cells: "text", isWide: false }, { name: "detail", cells: "text", isWide: false }, { name: "x_m", cells: "f32", isWide: false }, { name: "y_m", cells: "f32", isWide: false }] },
  { name: "goal", number: 9, columns: [{ name: "t_ns", cells: "i64", isWide: false }, { name: "standing", cells: "u8", isWide: false }, { name: "margin", cells: "f64", isWide: false }, { name: "says", cells: "text", isWide: false }] },
  { name: "state", number: 10, columns: [{ name: "t_ns", cells: "i64", isWide: false }, { name: "state", cells: "u32", isWide: false }, { name: "cause", cells: "text", isWide: false }] },
  { name: "source", number: 11, columns: [{ name: "t_ns", cells: "i64", isWide: false }, { name: "file", cells: "text", isWide: false }, { name: "line", cells: "u32", isWide: false }] },
  { name: "things", number: 12, columns: [{ name: "t_ns", cells: "i64", isWide: false }, { name: "thing", cells: "u32", isWide: false }, { name: "is_there", cells: "u8", isWide: false }, { name: "x_m", cells: "f32", isWide: false }, { name: "y_m", cells: "f32", isWide: false }, { name: "heading_rad", cells: "f32", isWide: false }] },
];

export interface KindColumns {
  readonly levels: LevelsColumns;
  readonly waves: WavesColumns;
  readonly samples: SamplesColumns;
  readonly pose: PoseColumns;
  readonly ranges: RangesColumns;
  readonly packets: PacketsColumns;
  readonly text: TextColumns;
  readonly events: EventsColumns;
  readonly goal: GoalColumns;
  readonly state: StateColumns;
  readonly source: SourceColumns;
  readonly things: ThingsColumns;
}

/** What the server says in a text message, beside the header, which comes first and anew when it changes. */
export interface Answered {
  readonly header: PageHeader | null;
  readonly done: number | null;
  readonly lost: number | null;
  readonly now_ns: number | null;
  readonly refused: string | null;
  readonly run: RunState | null;
  readonly may_control: boolean | null;
  readonly offered: readonly string[] | null;
  readonly panel: PanelState | null;
}

/** A channel: what its rows are of. */
export interface ChannelHeader {
  readonly name: string;
  readonly kind: string;
  readonly id: number;
  readonly unit: string;
  readonly group: string;
  readonly source: string;
  readonly doc: string;
  readonly of: number;
  readonly width: number;
  readonly is_stepped: boolean;
  readonly mark: number | null;
  readonly sensors: readonly SensorPlace[];
  readonly cone_rad: number;
  readonly range_m: number;
  readonly states: readonly string[];
  readonly transitions: readonly StateTransition[];
}

/** A fault that can be injected: `fault NAME WORD …`. */
export interface FaultOffer {
  readonly name: string;
  readonly doc: string;
  readonly words: readonly WordOffer[];
  readonly is_momentary: boolean;
}

/** What hands can do in what is shown, beside moving its things. */
export interface HandsOffer {
  readonly robot: string;
  readonly faults: readonly FaultOffer[];
  readonly buttons: readonly string[];
  readonly pins: readonly string[];
  readonly analog_pins: readonly string[];
  readonly ports: readonly string[];
  readonly most_mps: number;
  readonly most_dps: number;
  readonly is_real: boolean;
}

/** A cell of a table. */
export interface PageCell {
  readonly text: string;
  readonly href: string;
  readonly standing: "" | "passed" | "failed" | "open";
  readonly is_number: boolean;
  readonly at_ns: number | null;
}

/** One of the curves, or rows of points, of a plot. */
export interface PageCurve {
  readonly name: string;
  readonly x: readonly number[];
  readonly y: readonly number[];
  readonly style: "line" | "step" | "points" | "bars";
  readonly labels: readonly string[];
  readonly hrefs: readonly string[];
}

/** A drawing of shapes. */
export interface PageDrawing {
  readonly kind: "drawing";
  readonly title: string;
  readonly alt: string;
  readonly width: number;
  readonly height: number;
  readonly shapes: readonly PictureShape[];
}

/** What a page begins with. */
export interface PageHeader {
  readonly format: number;
  readonly title: string;
  readonly verdict: string;
  readonly standing: "" | "passed" | "failed" | "open";
  readonly lead: string;
  readonly why: string;
  readonly start_ns: number;
  readonly end_ns: number;
  readonly is_live: boolean;
  readonly channels: readonly ChannelHeader[];
  readonly world: WorldHeader | null;
  readonly robots: readonly RobotHeader[];
  readonly hands: HandsOffer | null;
  readonly robot_hands: readonly HandsOffer[];
  readonly sections: readonly PageSection[];
  readonly panels: readonly PanelHeader[];
  readonly left_out: readonly string[];
  readonly footer: string;
}

/** Lines, each with how it came out. */
export interface PageList {
  readonly kind: "list";
  readonly title: string;
  readonly items: readonly PageCell[];
}

/** A picture: base64 of a PNG. */
export interface PagePicture {
  readonly kind: "picture";
  readonly title: string;
  readonly alt: string;
  readonly png: string;
}

/** A small plan of a world with ways in it: metres. */
export interface PagePlan {
  readonly kind: "plan";
  readonly title: string;
  readonly text: string;
  readonly listing: string;
  readonly opens: number | null;
  readonly world: WorldHeader | null;
  readonly ways: readonly PageCurve[];
  readonly hits: readonly (readonly [number, number])[];
  readonly places: readonly (readonly [number, number, string])[];
}

/** A plot that is not over the run's time, with ticks and units on both axes. */
export interface PagePlot {
  readonly kind: "plot";
  readonly title: string;
  readonly x_name: string;
  readonly x_unit: string;
  readonly y_name: string;
  readonly y_unit: string;
  readonly curves: readonly PageCurve[];
  readonly is_equal: boolean;
  readonly marks: readonly number[];
}

/** A titled part of a report. */
export interface PageSection {
  readonly title: string;
  readonly note: string;
  readonly blocks: readonly (PageTable | PageText | PagePicture | PagePlot | PageList | PagePlan | PageDrawing | PageSource)[];
  readonly is_folded: boolean;
}

/** Lines of a source file, and which of them have run by the page's time. */
export interface PageSource {
  readonly kind: "source";
  readonly title: string;
  readonly lines: readonly string[];
  readonly first: number;
  readonly ran_ns: readonly number[];
  readonly one_way: readonly number[];
  readonly next: number;
}

/** A table; one without `head` has names in its first column. */
export interface PageTable {
  readonly kind: "table";
  readonly title: string;
  readonly head: readonly string[];
  readonly rows: readonly (readonly PageCell[])[];
}

/** A text as it is: a listing where `is_listing`, else a paragraph. */
export interface PageText {
  readonly kind: "text";
  readonly title: string;
  readonly text: string;
  readonly is_listing: boolean;
}

/** A panel: a view of what runs, as it is now. */
export interface PanelHeader {
  readonly name: string;
  readonly title: string;
  readonly choices: readonly string[];
  readonly sections: readonly PageSection[];
}

/** What a panel shows. */
export interface PanelState {
  readonly name: string;
  readonly choice: string;
  readonly at_ns: number;
  readonly sections: readonly PageSection[];
}

/** A shape of a drawing; lengths in those of the drawing, y down. */
export interface PictureShape {
  readonly kind: "box" | "circle" | "text";
  readonly x: number;
  readonly y: number;
  readonly width: number;
  readonly height: number;
  readonly text: string;
  readonly align: "start" | "middle" | "end";
  readonly role: string;
  readonly title: string;
}

/** A robot: its outline around the point that its pose says. */
export interface RobotHeader {
  readonly name: string;
  readonly model: string;
  readonly front_m: number;
  readonly rear_m: number;
  readonly width_m: number;
  readonly height_m: number;
}

/** Where a range sensor sits on its robot. */
export interface SensorPlace {
  readonly name: string;
  readonly x_m: number;
  readonly y_m: number;
  readonly bearing_rad: number;
}

/** From one state to another, as places in `states`, and what leads there. */
export interface StateTransition {
  readonly source: number;
  readonly target: number;
  readonly cause: string;
}

/** What a page asks for: rows of channels within a time, as many as its pixels can show. */
export interface Wanted {
  readonly want: readonly number[];
  readonly from_ns: number;
  readonly to_ns: number;
  readonly pixels: number;
  readonly id: number;
}

/** A word behind the name of a fault: one of `choices`, or a number. */
export interface WordOffer {
  readonly name: string;
  readonly choices: readonly string[];
  readonly least: number;
  readonly most: number;
  readonly step: number;
  readonly usual: string;
}

/** The world. */
export interface WorldHeader {
  readonly name: string;
  readonly extent_m: readonly [number, number, number, number];
  readonly things: readonly WorldThing[];
}

/** A thing of the world, where it stands at the start. */
export interface WorldThing {
  readonly name: string;
  readonly kind: string;
  readonly shape: "box" | "cylinder" | "polygon";
  readonly x_m: number;
  readonly y_m: number;
  readonly heading_rad: number;
  readonly z_m: number;
  readonly height_m: number;
  readonly length_m: number;
  readonly width_m: number;
  readonly radius_m: number;
  readonly points: readonly (readonly [number, number])[];
  readonly is_there: boolean;
}

/** A future of the run. */
export interface FutureState {
  readonly name: string;
  readonly source: string;
  readonly parent: string;
  readonly at_ns: number;
  readonly head_ns: number;
  readonly end_ns: number;
  readonly words: string;
  readonly is_over: boolean;
  readonly against: string;
  readonly until_ns: number;
  readonly parting: readonly PartingState[];
}

/** A place where the run halts: a line, a variable, or an event in words. */
export interface HaltState {
  readonly number: number;
  readonly words: string;
  readonly count: number;
}

/** What a hand did, and when. */
export interface HandState {
  readonly at_ns: number;
  readonly words: string;
}

/** A run that was made of what a report shows: how it stands, and where it is seen; empty: not yet, or nowhere. */
export interface OpenedRun {
  readonly number: number;
  readonly words: string;
  readonly url: string;
}

/** Where a signal of two futures differs first. */
export interface PartingState {
  readonly signal: string;
  readonly at_ns: number;
  readonly one: string;
  readonly other: string;
}

/** What a page asks of a run. */
export interface RunCommand {
  readonly do: "run" | "pause" | "go" | "step" | "back" | "speed" | "fork" | "choose" | "drop" | "compare" | "halt_at" | "halt_not_at" | "watch" | "watch_not" | "hand" | "drive" | "stop" | "save" | "open";
  readonly at_ns: number | null;
  readonly unit: "instruction" | "line" | "edge" | "packet" | "event" | "millisecond";
  readonly speed: number;
  readonly words: string;
  readonly future: string;
  readonly robot: string;
  readonly number: number;
  readonly forward_mps: number;
  readonly turn_dps: number;
}

/** How a run stands. */
export interface RunState {
  readonly is_running: boolean;
  readonly speed: number;
  readonly head_ns: number;
  readonly why: string;
  readonly place: string;
  readonly trouble: string;
  readonly done: number;
  readonly future: string;
  readonly futures: readonly FutureState[];
  readonly halts: readonly HaltState[];
  readonly variables: readonly string[];
  readonly hand_count: number;
  readonly hands: readonly HandState[];
  readonly saved: string;
  readonly opened: readonly OpenedRun[];
}

export type Standing = "" | "passed" | "failed" | "open";
export type PageBlock = PageTable | PageText | PagePicture | PagePlot | PageList | PagePlan | PageDrawing | PageSource;
export type Doing = "run" | "pause" | "go" | "step" | "back" | "speed" | "fork" | "choose" | "drop" | "compare" | "halt_at" | "halt_not_at" | "watch" | "watch_not" | "hand" | "drive" | "stop" | "save" | "open";
export type StepUnit = "instruction" | "line" | "edge" | "packet" | "event" | "millisecond";
