// The second script: three, and the 3D view drawn with it.
import { mountScene } from "./views/scene/drawing";

window.p2osScene = mountScene;
