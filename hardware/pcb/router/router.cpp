// Two-layer maze router with negotiated congestion (the idea of PathFinder, McMurchie and Ebeling 1995).
//
// Reads a board in words from standard input, writes tracks and vias to standard output, progress to
// standard error. No clock, no randomness, no threads: same input, same output. Distances in millimetres.
//
// Theory of operation. Every cell of a square raster is a place where the centre of a track or of a via
// may stand. Each net belongs to a class (track width, via diameter). For each class the program keeps
// three rasters of foreign copper: track on layer 0, track on layer 1, via. Pads and keep-outs block
// cells for good (`fixed`). The copper of routed nets only counts there (`busy`): a path may cross it at
// a price that grows round by round, nets in conflict are ripped up and routed anew, and places that
// were fought over stay costly (`history`). It ends when no cell is used twice.
//
// Input:  grid W H edge ; classes N then (track clearance via drill) each ; nets N then (name class) each ;
//         pads N then (net layers x0 y0 x1 y1) each, net -1 for foreign copper ;
//         keepouts N then (x0 y0 x1 y1) each ; stitch net pitch
// Output: T net layer x0 y0 x1 y1 width | V net x y diameter drill | S like V: a place for a stitching via
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <numeric>
#include <queue>
#include <string>
#include <unordered_map>
#include <vector>

namespace {

constexpr double kSlack = 0.005;        // chosen: rounding never eats the clearance
constexpr float kViaCost = 12.0F;       // chosen: a via is worth 3 mm of track
constexpr float kWrongWay = 1.25F;      // layer 0 runs across, layer 1 runs down the board
constexpr float kBend = 0.6F;           // chosen: straight tracks are easier to follow
constexpr float kUnreached = 1e30F;
constexpr int kRounds = 150;
constexpr int kVia = 2;                 // raster index: 0 and 1 are the layers
constexpr int kFree = -1, kNobody = -2; // owners of a fixed cell beside net numbers

struct Class { double track, clearance, via, drill; };
struct Net { std::string name; int cls; std::vector<int> pads; };
struct Rect { double x0, y0, x1, y1; };
struct Pad { int net, layers; Rect box; std::vector<int> nodes; };

struct Router {
    double grid = 0, width = 0, height = 0, edge = 0;
    int nx = 0, ny = 0, cells = 0;
    std::vector<Class> classes;
    std::vector<Net> nets;
    std::vector<Pad> pads;
    std::vector<Rect> keepouts;
    std::string stitch_net;
    double stitch_pitch = 0;
    std::vector<std::vector<int>> fixed[3], busy[3];   // [raster][class][cell]
    std::vector<std::vector<float>> history[3];
    std::vector<std::vector<std::vector<int>>> paths;  // [net][path][node], node = layer * cells + cell
    std::vector<std::vector<std::vector<int>>> marks;  // [net][raster * classes + class][cell]

    double reach(int cls, int raster) const { return (raster == kVia ? classes[cls].via : classes[cls].track) / 2; }

    void read() {
        std::string word;
        int count = 0;
        std::cin >> word >> grid >> width >> height >> edge;
        nx = static_cast<int>(width / grid) + 1;
        ny = static_cast<int>(height / grid) + 1;
        cells = nx * ny;
        std::cin >> word >> count;
        classes.resize(count);
        for (auto& c : classes) std::cin >> c.track >> c.clearance >> c.via >> c.drill;
        std::cin >> word >> count;
        nets.resize(count);
        for (auto& n : nets) std::cin >> n.name >> n.cls;
        std::cin >> word >> count;
        pads.resize(count);
        for (auto& p : pads) std::cin >> p.net >> p.layers >> p.box.x0 >> p.box.y0 >> p.box.x1 >> p.box.y1;
        std::cin >> word >> count;
        keepouts.resize(count);
        for (auto& k : keepouts) std::cin >> k.x0 >> k.y0 >> k.x1 >> k.y1;
        std::cin >> word >> stitch_net >> stitch_pitch;
        for (size_t i = 0; i < pads.size(); i++)
            if (pads[i].net >= 0) nets[pads[i].net].pads.push_back(static_cast<int>(i));
    }

    template <typename Mark> void around(const Rect& box, double radius, Mark mark) const {
        const int left = std::max(0, static_cast<int>((box.x0 - radius) / grid) - 1);
        const int right = std::min(nx - 1, static_cast<int>((box.x1 + radius) / grid) + 1);
        const int top = std::max(0, static_cast<int>((box.y0 - radius) / grid) - 1);
        const int bottom = std::min(ny - 1, static_cast<int>((box.y1 + radius) / grid) + 1);
        for (int y = top; y <= bottom; y++)
            for (int x = left; x <= right; x++) {
                const double dx = std::max({box.x0 - x * grid, 0.0, x * grid - box.x1});
                const double dy = std::max({box.y0 - y * grid, 0.0, y * grid - box.y1});
                if (dx * dx + dy * dy < radius * radius - 1e-9) mark(y * nx + x);
            }
    }

    void block(int raster, int cls, const Rect& box, double radius, int net) {
        auto& owner = fixed[raster][cls];
        around(box, radius, [&](int cell) {
            if (owner[cell] == kFree) owner[cell] = net;
            else if (owner[cell] != net) owner[cell] = kNobody;
        });
    }

    void prepare() {
        const int count = static_cast<int>(classes.size());
        for (int raster = 0; raster < 3; raster++) {
            fixed[raster].assign(count, std::vector<int>(cells, kFree));
            busy[raster].assign(count, std::vector<int>(cells, 0));
            history[raster].assign(count, std::vector<float>(cells, 0));
            for (int cls = 0; cls < count; cls++) {
                const double own = reach(cls, raster) + kSlack;
                for (const auto& pad : pads) {
                    const bool touches = raster == kVia || ((pad.layers >> raster) & 1) != 0;
                    if (touches) block(raster, cls, pad.box, own + classes[cls].clearance, pad.net >= 0 ? pad.net : kNobody);
                }
                for (const auto& area : keepouts) block(raster, cls, area, own, kNobody);
                const double rim = edge + own;
                for (int y = 0; y < ny; y++)
                    for (int x = 0; x < nx; x++)
                        if (x * grid < rim || y * grid < rim || width - x * grid < rim || height - y * grid < rim)
                            fixed[raster][cls][y * nx + x] = kNobody;
            }
        }
        for (auto& pad : pads) {
            if (pad.net < 0) continue;
            const int cls = nets[pad.net].cls;
            for (int layer = 0; layer < 2; layer++) {
                if (((pad.layers >> layer) & 1) == 0) continue;
                const double cx = (pad.box.x0 + pad.box.x1) / 2, cy = (pad.box.y0 + pad.box.y1) / 2;
                // Ends stay near the middle of a pad, so that the last straight piece to its centre lies inside it.
                const double rx = std::max(0.13, (pad.box.x1 - pad.box.x0) / 2 - 0.4), ry = std::max(0.13, (pad.box.y1 - pad.box.y0) / 2 - 0.4);
                for (int y = static_cast<int>(std::ceil((cy - ry) / grid)); y * grid <= cy + ry + 1e-9; y++)
                    for (int x = static_cast<int>(std::ceil((cx - rx) / grid)); x * grid <= cx + rx + 1e-9; x++) {
                        const int owner = fixed[layer][cls][y * nx + x];
                        if (owner == pad.net || owner == kFree) pad.nodes.push_back(layer * cells + y * nx + x);
                    }
            }
            if (pad.nodes.empty()) std::cerr << "pad of " << nets[pad.net].name << " at " << pad.box.x0 << " " << pad.box.y0 << " has no free cell\n";
        }
        paths.resize(nets.size());
        marks.resize(nets.size());
    }

    void count(int net, int sign) {
        const int n = static_cast<int>(classes.size());
        if (marks[net].empty()) return;
        for (int raster = 0; raster < 3; raster++)
            for (int cls = 0; cls < n; cls++)
                for (int cell : marks[net][raster * n + cls]) busy[raster][cls][cell] += sign;
    }

    void mark(int net) {
        const int n = static_cast<int>(classes.size());
        marks[net].assign(3 * n, {});
        const Class& own = classes[nets[net].cls];
        for (int raster = 0; raster < 3; raster++)
            for (int cls = 0; cls < n; cls++) {
                auto& cellsof = marks[net][raster * n + cls];
                const double gap = std::max(own.clearance, classes[cls].clearance) + reach(cls, raster);
                auto disc = [&](int cell, double radius) {
                    const double x = cell % nx * grid, y = cell / nx * grid;
                    // A diagonal step passes its neighbours half a cell nearer than its two ends do.
                    around({x, y, x, y}, std::sqrt(radius * radius + grid * grid / 2), [&](int c) { cellsof.push_back(c); });
                };
                for (const auto& path : paths[net])
                    for (size_t i = 0; i < path.size(); i++) {
                        const int layer = path[i] / cells, cell = path[i] % cells;
                        if (raster == kVia || raster == layer) disc(cell, own.track / 2 + gap);
                        if (i > 0 && path[i - 1] % cells == cell) disc(cell, own.via / 2 + gap);
                    }
                std::sort(cellsof.begin(), cellsof.end());
                cellsof.erase(std::unique(cellsof.begin(), cellsof.end()), cellsof.end());
            }
    }

    bool open(int raster, int net, int cell) const {
        const int owner = fixed[raster][nets[net].cls][cell];
        return owner == kFree || owner == net;
    }

    bool route(int net, float pressure) {
        static std::vector<float> cost;
        static std::vector<int> from;
        paths[net].clear();
        const int cls = nets[net].cls;
        const auto& own = nets[net].pads;
        std::vector<char> done(own.size(), 0);
        std::vector<int> tree = pads[own[0]].nodes;
        done[0] = 1;
        std::unordered_map<int, size_t> target;
        for (size_t i = 1; i < own.size(); i++)
            for (int node : pads[own[i]].nodes) target.emplace(node, i);
        static const int dx[] = {1, 1, 0, -1, -1, -1, 0, 1}, dy[] = {0, 1, 1, 1, 0, -1, -1, -1};
        for (size_t left = own.size() - 1; left > 0; left--) {
            cost.assign(2 * static_cast<size_t>(cells), kUnreached);
            from.assign(2 * static_cast<size_t>(cells), -1);
            std::priority_queue<std::pair<float, int>, std::vector<std::pair<float, int>>, std::greater<>> queue;
            for (int node : tree) { cost[node] = 0; queue.emplace(0.0F, node); }
            int end = -1;
            while (!queue.empty()) {
                const auto [spent, node] = queue.top();
                queue.pop();
                if (spent > cost[node]) continue;
                const auto hit = target.find(node);
                if (hit != target.end() && done[hit->second] == 0) { end = node; break; }
                const int layer = node / cells, cell = node % cells, x = cell % nx, y = cell / nx;
                const int before = from[node];
                const int step = before >= 0 && before / cells == layer ? cell - before % cells : 0;
                auto relax = [&](int next, float price) {
                    if (spent + price < cost[next]) { cost[next] = spent + price; from[next] = node; queue.emplace(cost[next], next); }
                };
                for (int k = 0; k < 8; k++) {
                    const int X = x + dx[k], Y = y + dy[k];
                    if (X < 0 || Y < 0 || X >= nx || Y >= ny) continue;
                    const int next = Y * nx + X;
                    if (!open(layer, net, next)) continue;
                    const bool across = dy[k] == 0, diagonal = dx[k] != 0 && dy[k] != 0;
                    float price = diagonal ? 1.4142F : 1.0F;
                    if (!diagonal && across != (layer == 0)) price *= kWrongWay;
                    if (step != 0 && step != next - cell) price += kBend;
                    price *= 1.0F + history[layer][cls][next];
                    price += pressure * static_cast<float>(busy[layer][cls][next]);
                    relax(layer * cells + next, price);
                }
                if (open(kVia, net, cell) && open(1 - layer, net, cell))
                    relax((1 - layer) * cells + cell, kViaCost * (1.0F + history[kVia][cls][cell]) + pressure * static_cast<float>(2 * busy[kVia][cls][cell] + busy[1 - layer][cls][cell]));
            }
            if (end < 0) return false;
            std::vector<int> path;
            for (int node = end; node >= 0; node = from[node]) path.push_back(node);
            std::reverse(path.begin(), path.end());
            tree.insert(tree.end(), path.begin(), path.end());
            paths[net].push_back(std::move(path));
            const size_t pad = target[end];
            done[pad] = 1;
            tree.insert(tree.end(), pads[own[pad]].nodes.begin(), pads[own[pad]].nodes.end());
        }
        return true;
    }

    // Calls back for every place where a net's copper stands in another net's clearance.
    template <typename Found> void conflicts(int net, Found found) const {
        const int cls = nets[net].cls;
        for (const auto& path : paths[net])
            for (size_t i = 0; i < path.size(); i++) {
                const int layer = path[i] / cells, cell = path[i] % cells;
                if (busy[layer][cls][cell] > 1) found(layer, cell);
                if (i > 0 && path[i - 1] % cells == cell && busy[kVia][cls][cell] > 1) found(kVia, cell);
            }
    }

    bool run() {
        std::vector<int> order(nets.size());
        std::iota(order.begin(), order.end(), 0);
        auto span = [&](int net) {
            double x0 = 1e9, x1 = -1e9, y0 = 1e9, y1 = -1e9;
            for (int i : nets[net].pads) {
                x0 = std::min(x0, pads[i].box.x0); x1 = std::max(x1, pads[i].box.x1);
                y0 = std::min(y0, pads[i].box.y0); y1 = std::max(y1, pads[i].box.y1);
            }
            return x1 - x0 + y1 - y0;
        };
        std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return span(a) < span(b); });
        float pressure = 1.0F;
        for (int round = 0; round < kRounds; round++) {
            int failed = 0, fights = 0;
            for (int net : order) {
                if (nets[net].pads.size() < 2) continue;
                bool again = paths[net].empty();
                conflicts(net, [&](int, int) { again = true; });
                if (!again) continue;
                count(net, -1);
                if (!route(net, pressure)) { failed++; std::cerr << "no way for " << nets[net].name << "\n"; }
                mark(net);
                count(net, +1);
            }
            for (size_t net = 0; net < nets.size(); net++)
                conflicts(static_cast<int>(net), [&](int raster, int cell) { fights++; history[raster][nets[net].cls][cell] += 0.4F; });
            std::cerr << "round " << round << ": " << fights << " conflicts, " << failed << " without a way\n";
            if (fights == 0) return failed == 0;
            pressure = std::min(pressure * 1.3F, 60.0F);
        }
        return false;
    }

    void stitch() const {
        int net = -1;
        for (size_t i = 0; i < nets.size(); i++) if (nets[i].name == stitch_net) net = static_cast<int>(i);
        if (net < 0 || stitch_pitch <= 0) return;
        const Class& cls = classes[nets[net].cls];
        const int own = nets[net].cls, step = static_cast<int>(stitch_pitch / grid), search = step / 4;
        std::vector<int> copper(cells, 0);   // cells near the net's own vias and pads: a second via there serves nobody
        for (const auto& pad : pads) around(pad.box, cls.via / 2 + 0.4, [&](int cell) { copper[cell] = 1; });
        for (const auto& path : paths[net])
            for (size_t i = 1; i < path.size(); i++)
                if (path[i] % cells == path[i - 1] % cells) {
                    const double x = path[i] % cells % nx * grid, y = path[i] % cells / nx * grid;
                    around({x, y, x, y}, 2.0, [&](int cell) { copper[cell] = 1; });
                }
        const std::vector<int> empty;
        for (int gy = step / 2; gy < ny; gy += step)
            for (int gx = step / 2; gx < nx; gx += step) {
                int best = -1, distance = 1 << 30;
                for (int y = std::max(0, gy - search); y <= std::min(ny - 1, gy + search); y++)
                    for (int x = std::max(0, gx - search); x <= std::min(nx - 1, gx + search); x++) {
                        const int cell = y * nx + x, far = (x - gx) * (x - gx) + (y - gy) * (y - gy);
                        const bool mine = std::binary_search(marks[net][kVia * classes.size() + own].begin(), marks[net][kVia * classes.size() + own].end(), cell);
                        if (far < distance && copper[cell] == 0 && open(kVia, net, cell) && busy[kVia][own][cell] <= (mine ? 1 : 0)) { best = cell; distance = far; }
                    }
                if (best < 0) continue;
                std::printf("S %s %.3f %.3f %.2f %.2f\n", nets[net].name.c_str(), best % nx * grid, best / nx * grid, cls.via, cls.drill);
            }
    }

    void write() const {
        for (size_t net = 0; net < nets.size(); net++) {
            const Class& cls = classes[nets[net].cls];
            const char* name = nets[net].name.c_str();
            auto track = [&](int layer, double x0, double y0, double x1, double y1) {
                std::printf("T %s %d %.3f %.3f %.3f %.3f %.2f\n", name, layer, x0, y0, x1, y1, cls.track);
            };
            auto stub = [&](int node) {   // from the raster to the centre of the pad that the path ends in
                for (int i : nets[net].pads) {
                    const auto& found = pads[i].nodes;
                    if (std::find(found.begin(), found.end(), node) == found.end()) continue;
                    const double x = node % cells % nx * grid, y = node % cells / nx * grid;
                    const double cx = (pads[i].box.x0 + pads[i].box.x1) / 2, cy = (pads[i].box.y0 + pads[i].box.y1) / 2;
                    if (std::hypot(x - cx, y - cy) > 1e-6) track(node / cells, x, y, cx, cy);
                    return;
                }
            };
            for (const auto& path : paths[net]) {
                stub(path.front());
                for (size_t i = 0; i + 1 < path.size();) {
                    const int layer = path[i] / cells, cell = path[i] % cells;
                    if (path[i + 1] / cells != layer) {
                        std::printf("V %s %.3f %.3f %.2f %.2f\n", name, cell % nx * grid, cell / nx * grid, cls.via, cls.drill);
                        i++;
                        continue;
                    }
                    size_t j = i + 1;
                    const int step = path[j] - path[i];
                    while (j + 1 < path.size() && path[j + 1] - path[j] == step) j++;
                    track(layer, cell % nx * grid, cell / nx * grid, path[j] % cells % nx * grid, path[j] % cells / nx * grid);
                    i = j;
                }
                if (path.size() > 1) stub(path.back());
            }
        }
    }
};

}  // namespace

int main() {
    Router router;
    router.read();
    router.prepare();
    if (!router.run()) return 1;
    router.write();
    router.stitch();
    return 0;
}
