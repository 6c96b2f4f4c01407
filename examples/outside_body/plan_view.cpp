// A body for p2os in another program: a differential drive in a plan view, with walls of its own.
//
//   g++ -std=c++17 -O2 -o plan_view plan_view.cpp
//   ./plan_view unix:/tmp/body --wall 2,-1,2,1        then: p2os run dodge --body unix:/tmp/body
//
// It speaks the protocol of docs/outside-body.md and needs no library. Each connection is a process of its own, so that
// forks of a bench have bodies of their own. Not modelled: masses (what can be pushed stands fast), slopes, meshes.
// Numbers are copied as they lie in memory: the machine must be little-endian, as x86 and ARM are.
#include <arpa/inet.h>
#include <csignal>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <stdexcept>
#include <string>
#include <vector>

namespace {

constexpr double kInfinity = HUGE_VAL;
constexpr std::uint32_t kLongestFrame = 64u << 20;
constexpr int kRaysPerSonar = 9;

enum Type : std::uint8_t {
    kHello = 1, kMakeWorld, kPlace, kPlaceMesh, kMove, kRemove, kReset, kStandAt, kStep, kAskRanges, kAskRays, kSave,
    kRestore, kBye, kAnswer = 0x80, kFailed = 0xFF
};
enum Ability : std::uint16_t { kSaves = 1, kCastsRays = 2, kRolls = 4 };
enum Bits : std::uint8_t { kStalledLeft = 1, kStalledRight = 2, kTouches = 4 };

// The wire ----------------------------------------------------------------------------------

class Reader {
public:
    explicit Reader(std::vector<char> data) : data_(std::move(data)) {}

    template <typename Number> Number take() {
        Number value;
        std::memcpy(&value, bytes(sizeof value), sizeof value);
        return value;
    }
    std::string text(std::size_t size) { return {bytes(size), size}; }
    std::string text() { return text(take<std::uint16_t>()); }
    void end() const {
        if (at_ != data_.size()) throw std::runtime_error("a message is too long");
    }

private:
    const char* bytes(std::size_t size) {
        if (size > data_.size() - at_) throw std::runtime_error("a message is too short");
        at_ += size;
        return data_.data() + at_ - size;
    }
    std::vector<char> data_;
    std::size_t at_ = 0;
};

class Writer {
public:
    template <typename Number> Writer& put(Number value) {
        const char* from = reinterpret_cast<const char*>(&value);
        data.insert(data.end(), from, from + sizeof value);
        return *this;
    }
    Writer& text(const std::string& text) {
        put(static_cast<std::uint16_t>(text.size()));
        data.insert(data.end(), text.begin(), text.end());
        return *this;
    }
    std::vector<char> data;
};

bool read_all(int line, void* to, std::size_t size) {
    for (char* at = static_cast<char*>(to); size > 0;) {
        const ssize_t got = read(line, at, size);
        if (got <= 0) return false;
        at += got, size -= static_cast<std::size_t>(got);
    }
    return true;
}

bool write_frame(int line, std::uint8_t type, const std::vector<char>& payload) {
    Writer frame;
    frame.put(static_cast<std::uint32_t>(payload.size() + 1)).put(type);
    frame.data.insert(frame.data.end(), payload.begin(), payload.end());
    const char* at = frame.data.data();
    for (std::size_t left = frame.data.size(); left > 0;) {
        const ssize_t sent = write(line, at, left);
        if (sent <= 0) return false;
        at += sent, left -= static_cast<std::size_t>(sent);
    }
    return true;
}

// The plan ----------------------------------------------------------------------------------

struct Point { double x, y; };
struct Segment { Point a, b; };
struct Thing {
    std::string name;
    std::uint8_t kind;
    double x, y, heading, length, width, radius, base, height, mass, friction;
};
struct Pose { double x = 0, y = 0, heading = 0, z = 0; };
struct Hit { double distance, cosine; };

double cross(Point a, Point b) { return a.x * b.y - a.y * b.x; }
Point operator-(Point a, Point b) { return {a.x - b.x, a.y - b.y}; }
Point placed(Point p, const Pose& at) {
    const double c = std::cos(at.heading), s = std::sin(at.heading);
    return {at.x + p.x * c - p.y * s, at.y + p.x * s + p.y * c};
}

double distance(Point p, const Segment& to) {
    const Point along = to.b - to.a, rel = p - to.a;
    const double square = along.x * along.x + along.y * along.y;
    const double share = square == 0 ? 0 : std::clamp((rel.x * along.x + rel.y * along.y) / square, 0.0, 1.0);
    return std::hypot(rel.x - share * along.x, rel.y - share * along.y);
}

double distance(const Segment& one, const Segment& other) {
    const Point d = one.b - one.a, e = other.b - other.a;
    if (cross(d, other.a - one.a) * cross(d, other.b - one.a) < 0 && cross(e, one.a - other.a) * cross(e, one.b - other.a) < 0)
        return 0;
    return std::min({distance(one.a, other), distance(one.b, other), distance(other.a, one), distance(other.b, one)});
}

std::vector<Segment> edges(const std::vector<Point>& outline, const Pose& at) {
    std::vector<Segment> found;
    for (std::size_t i = 0; i < outline.size(); ++i)
        found.push_back({placed(outline[i], at), placed(outline[(i + 1) % outline.size()], at)});
    return found;
}

bool is_inside(Point p, const std::vector<Segment>& outline) {
    return std::all_of(outline.begin(), outline.end(), [&](const Segment& e) { return cross(e.b - e.a, p - e.a) >= 0; });
}

std::vector<Segment> outline_of(const Thing& thing) {
    const double l = thing.length / 2, w = thing.width / 2;
    return edges({{l, w}, {-l, w}, {-l, -w}, {l, -w}}, {thing.x, thing.y, thing.heading, 0});
}

// The robot ---------------------------------------------------------------------------------

struct Motion {  // all that decides the future, beside the things: what is saved
    Pose pose;
    double left = 0, right = 0, left_mps = 0, right_mps = 0;
    std::uint64_t bits = 0;  // as wide as the rest, so that nothing between is undefined
};

class Body {
public:
    explicit Body(std::vector<Segment> walls) : walls_(std::move(walls)) {}

    // Answer a request; throws where it cannot be.
    std::vector<char> answer(std::uint8_t type, Reader in) {
        Writer out;
        switch (type) {
            case kHello: hello(in), out.put<std::uint16_t>(1).put<std::uint16_t>(kSaves | kCastsRays | kRolls)
                             .text("plan_view").text(""); break;
            case kMakeWorld: things_.clear(), in.text(), skip(in, 4); break;
            case kPlace: things_.push_back(thing(in)); break;
            case kMove: move(in); break;
            case kRemove: remove(in.text()); break;
            case kReset: motion_ = {}, motion_.pose = pose(in), in.take<std::uint64_t>(), report(out); break;
            case kStandAt: motion_.pose = pose(in), motion_.left_mps = motion_.right_mps = 0, report(out); break;
            case kStep: step(in, out); break;
            case kAskRanges: ranges(in, out); break;
            case kAskRays: rays(in, out); break;
            case kSave: out.put<std::uint32_t>(sizeof motion_).put(motion_); break;
            case kRestore: restore(in), report(out); break;
            case kBye: break;
            default: throw std::runtime_error(type == kPlaceMesh ? "a plan view of this kind has no meshes" : "what is that");
        }
        in.end();
        return out.data;
    }

private:
    static void skip(Reader& in, int numbers) {
        while (numbers-- > 0) in.take<double>();
    }
    static Pose pose(Reader& in) {
        Pose p;
        p.x = in.take<double>(), p.y = in.take<double>(), p.heading = in.take<double>(), p.z = in.take<double>();
        return p;
    }
    static Thing thing(Reader& in) {
        Thing t{in.text(), in.take<std::uint8_t>(), 0, 0, 0, 0, 0, 0, 0, 0, 0, 0};
        for (double* value : {&t.x, &t.y, &t.heading, &t.length, &t.width, &t.radius, &t.base, &t.height, &t.mass, &t.friction})
            *value = in.take<double>();
        return t;
    }

    void hello(Reader& in) {
        if (in.take<std::uint16_t>() != 1) throw std::runtime_error("plan_view speaks version 1");
        step_s_ = in.take<std::uint32_t>() / 1e9;
        in.text();
        track_ = in.take<double>(), radius_ = in.take<double>() / 2, low_ = in.take<double>(), high_ = in.take<double>();
        skip(in, 3);
        ring_ = in.take<double>(), range_ = in.take<double>(), skip(in, 1), cone_ = in.take<double>();
        for (int n = in.take<std::uint16_t>(); n-- > 0;) {
            const double x = in.take<double>();
            hull_.push_back({x, in.take<double>()});
        }
        for (int n = in.take<std::uint16_t>(); n-- > 0;) {
            Pose p;
            p.x = in.take<double>(), p.y = in.take<double>(), p.heading = in.take<double>();
            sonar_.push_back(p);
        }
    }

    Thing& find(const std::string& name) {
        for (Thing& t : things_)
            if (t.name == name) return t;
        throw std::runtime_error("there is no " + name);
    }
    void move(Reader& in) {
        Thing& t = find(in.text());
        t.x = in.take<double>(), t.y = in.take<double>(), t.heading = in.take<double>();
    }
    void remove(const std::string& name) {
        find(name);
        things_.erase(std::remove_if(things_.begin(), things_.end(), [&](const Thing& t) { return t.name == name; }),
                      things_.end());
    }
    void restore(Reader& in) {
        if (in.take<std::uint32_t>() != sizeof motion_) throw std::runtime_error("this is no state of mine");
        motion_ = in.take<Motion>();
    }

    // How far the hull at a pose is from the nearest thing, metres; 0 in contact; the thing's name.
    double clearance(const Pose& at, std::string* name) const {
        const std::vector<Segment> hull = edges(hull_, at);
        double nearest = 1e6;
        const auto take = [&](double far, const std::string& of) {
            if (far < nearest) nearest = far, *name = of;
        };
        const auto take_segment = [&](const Segment& wall, const std::string& of) {
            for (const Segment& e : hull) take(distance(e, wall), of);
            if (is_inside(wall.a, hull)) take(0, of);
        };
        for (const Segment& wall : walls_) take_segment(wall, "own wall");
        for (const Thing& t : things_) {
            if (t.kind > 1 || t.base >= high_ || t.base + t.height <= low_) continue;
            if (t.kind == 1) {
                const Point middle{t.x, t.y};
                for (const Segment& e : hull) take(std::max(0.0, distance(middle, e) - t.radius), t.name);
                if (is_inside(middle, hull)) take(0, t.name);
            } else {
                const std::vector<Segment> box = outline_of(t);
                for (const Segment& edge : box) take_segment(edge, t.name);
                if (is_inside(hull[0].a, box)) take(0, t.name);
            }
        }
        return nearest;
    }

    Hit cast(Point from, double heading, double longest) const {
        const Point d{std::cos(heading), std::sin(heading)};
        Hit best{longest, 0};
        const auto meet = [&](const Segment& s) {
            const Point e = s.b - s.a, q = s.a - from;
            const double across = cross(d, e);
            if (across == 0) return;
            const double along = cross(q, e) / across, share = cross(q, d) / across;
            if (along >= 0 && along < best.distance && share >= 0 && share <= 1)
                best = {along, std::min(1.0, std::fabs(across) / std::hypot(e.x, e.y))};
        };
        for (const Segment& wall : walls_) meet(wall);
        for (const Thing& t : things_) {
            if (t.kind > 1 || t.base > ring_ || t.base + t.height < ring_) continue;
            if (t.kind == 0) {
                for (const Segment& edge : outline_of(t)) meet(edge);
                continue;
            }
            const Point p = Point{t.x, t.y} - from;
            const double along = p.x * d.x + p.y * d.y, aside = cross(d, p);
            if (std::fabs(aside) >= t.radius) continue;
            const double half = std::sqrt(t.radius * t.radius - aside * aside);
            const double far = along >= half ? along - half : along + half;
            if (far >= 0 && far < best.distance) best = {far, half / t.radius};
        }
        return best.distance < longest ? best : Hit{kInfinity, 0};
    }

    void report(Writer& out) const {
        std::string name;
        const Motion& m = motion_;
        for (double value : {m.pose.x, m.pose.y, m.pose.z, std::remainder(m.pose.heading, 2 * M_PI), 0.0, m.left, m.right,
                             m.left_mps, m.right_mps, (m.left_mps + m.right_mps) / 2, (m.right_mps - m.left_mps) / track_,
                             clearance(m.pose, &name), 0.0})
            out.put(value);
    }

    void step(Reader& in, Writer& out) {
        const auto steps = in.take<std::uint32_t>();
        Writer touched;
        std::uint16_t touches = 0;
        out.put(steps);
        for (std::uint32_t n = 0; n < steps; ++n) {
            const double left = in.take<double>(), right = in.take<double>();
            in.take<std::uint8_t>();
            const bool was_touching = motion_.bits & kTouches;
            std::string name;
            if (!go(left, right, &name) && !was_touching) {
                touched.put(n).put(motion_.pose.x).put(motion_.pose.y).text(name);
                ++touches;
            }
            out.put(motion_.left).put(motion_.right).put(static_cast<std::uint8_t>(motion_.bits));
        }
        report(out);
        out.put(touches);
        out.data.insert(out.data.end(), touched.data.begin(), touched.data.end());
        out.put<std::uint16_t>(0);  // nothing is pushed
    }

    // Move on by one step along the exact arc, or stall where that leads into a thing.
    bool go(double left, double right, std::string* name) {
        Motion next = motion_;
        const double forward = (left + right) / 2 * step_s_, turn = (right - left) / track_ * step_s_;
        Pose& p = next.pose;
        if (std::fabs(turn) < 1e-9) {
            p.x += forward * std::cos(p.heading), p.y += forward * std::sin(p.heading);
        } else {
            const double radius = forward / turn, after = p.heading + turn;
            p.x += radius * (std::sin(after) - std::sin(p.heading));
            p.y -= radius * (std::cos(after) - std::cos(p.heading));
        }
        p.heading += turn;
        if (left == 0 && right == 0) {
            motion_.left_mps = motion_.right_mps = 0;
            motion_.bits &= kTouches;
            return true;
        }
        std::string there;
        if (clearance(p, name) == 0 && clearance(motion_.pose, &there) > 0) {
            motion_.left_mps = motion_.right_mps = 0;
            motion_.bits = kTouches | (left != 0 ? kStalledLeft : 0) | (right != 0 ? kStalledRight : 0);
            return false;
        }
        next.left += left * step_s_ / radius_, next.right += right * step_s_ / radius_;
        next.left_mps = left, next.right_mps = right, next.bits = 0;
        motion_ = next;
        return true;
    }

    void ranges(Reader& in, Writer& out) const {
        const auto count = in.take<std::uint16_t>();
        out.put(count);
        for (int n = 0; n < count; ++n) {
            const auto number = in.take<std::uint16_t>();
            if (number >= sonar_.size()) throw std::runtime_error("there is no such sonar");
            const Pose& sonar = sonar_[number];
            const Point from = placed({sonar.x, sonar.y}, motion_.pose);
            double nearest = kInfinity;
            for (int ray = 0; ray < kRaysPerSonar; ++ray) {
                const double aside = cone_ / 2 * (2.0 * ray / (kRaysPerSonar - 1) - 1);
                nearest = std::min(nearest, cast(from, motion_.pose.heading + sonar.heading + aside, range_).distance);
            }
            out.put(nearest);
        }
    }

    void rays(Reader& in, Writer& out) const {
        const double longest = in.take<double>();
        const auto count = in.take<std::uint32_t>();
        out.put(count);
        for (std::uint32_t n = 0; n < count; ++n) {
            const double x = in.take<double>(), y = in.take<double>(), heading = in.take<double>();
            const Hit hit = cast(placed({x, y}, motion_.pose), motion_.pose.heading + heading, longest);
            out.put(hit.distance).put(hit.cosine);
        }
    }

    std::vector<Segment> walls_;
    std::vector<Thing> things_;
    std::vector<Point> hull_;
    std::vector<Pose> sonar_;
    Motion motion_;
    double step_s_ = 0, track_ = 1, radius_ = 1, low_ = 0, high_ = 1, ring_ = 0, range_ = 5, cone_ = 0;
};

void serve(int line, Body body) {
    for (std::uint32_t size; read_all(line, &size, sizeof size);) {
        std::uint8_t type;
        if (size < 1 || size > kLongestFrame || !read_all(line, &type, 1)) return;
        std::vector<char> payload(size - 1);
        if (!read_all(line, payload.data(), payload.size())) return;
        std::vector<char> out;
        std::uint8_t kind = type | kAnswer;
        try {
            out = body.answer(type, Reader(std::move(payload)));
        } catch (const std::exception& error) {
            kind = kFailed, out = Writer().text(error.what()).data;
        }
        if (!write_frame(line, kind, out) || type == kBye) return;
    }
}

// Listen on unix:PATH or tcp:127.0.0.1:PORT (port 0: any that is free), and say where.
int listen_at(const std::string& address) {
    if (address.rfind("unix:", 0) == 0) {
        const std::string path = address.substr(5);
        sockaddr_un at{};
        at.sun_family = AF_UNIX;
        if (path.empty() || path.size() >= sizeof at.sun_path) return -1;
        std::memcpy(at.sun_path, path.c_str(), path.size());
        const int line = socket(AF_UNIX, SOCK_STREAM, 0);
        if (bind(line, reinterpret_cast<sockaddr*>(&at), sizeof at) != 0 || listen(line, 8) != 0) return -1;
        std::printf("listening on %s\n", address.c_str());
        return line;
    }
    if (address.rfind("tcp:127.0.0.1:", 0) != 0) return -1;
    sockaddr_in at{};
    socklen_t size = sizeof at;
    at.sin_family = AF_INET;
    at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    at.sin_port = htons(static_cast<std::uint16_t>(std::atoi(address.c_str() + 14)));
    const int line = socket(AF_INET, SOCK_STREAM, 0), yes = 1;
    setsockopt(line, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    if (bind(line, reinterpret_cast<sockaddr*>(&at), sizeof at) != 0 || listen(line, 8) != 0) return -1;
    getsockname(line, reinterpret_cast<sockaddr*>(&at), &size);
    std::printf("listening on tcp:127.0.0.1:%d\n", ntohs(at.sin_port));
    return line;
}

}  // namespace

int main(int argc, char** argv) {
    std::vector<Segment> walls;
    for (int n = 2; n + 1 < argc; n += 2) {
        Segment wall{};
        if (std::strcmp(argv[n], "--wall") != 0 ||
            std::sscanf(argv[n + 1], "%lf,%lf,%lf,%lf", &wall.a.x, &wall.a.y, &wall.b.x, &wall.b.y) != 4) {
            argc = 0;
            break;
        }
        walls.push_back(wall);
    }
    if (argc < 2 || argc % 2 != 0) {
        std::fprintf(stderr, "usage: plan_view unix:PATH|tcp:127.0.0.1:PORT [--wall X0,Y0,X1,Y1]...\n");
        return 2;
    }
    std::signal(SIGPIPE, SIG_IGN);
    std::signal(SIGCHLD, SIG_IGN);
    std::signal(SIGINT, [](int) { _exit(130); });
    const int listener = listen_at(argv[1]);
    if (listener < 0) {
        std::fprintf(stderr, "plan_view: cannot listen on %s\n", argv[1]);
        return 1;
    }
    std::fflush(stdout);
    for (;;) {
        const int line = accept(listener, nullptr, nullptr);
        if (line < 0) continue;
        const int yes = 1;
        setsockopt(line, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
        if (fork() == 0) {
            close(listener);
            serve(line, Body(walls));
            _exit(0);
        }
        close(line);
    }
}
