// What a body in C++ needs of the protocol of docs/outside-body.md: frames, the robot's measures, things in a plan and the
// rays that meet them, and a process a connection. It needs no library; the engine stands in the file that includes it.
//
// Numbers are copied as they lie in memory: the machine must be little-endian, as x86 and ARM are.
#pragma once

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

namespace lock_step {

constexpr double kInfinity = HUGE_VAL;
constexpr std::uint32_t kLongestFrame = 64u << 20;
// Bytes of a Hello at most; a web browser that connects begins with what would be a longer one, or none.
constexpr std::uint32_t kLongestHello = 1u << 16;
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

inline bool read_all(int line, void* to, std::size_t size) {
    for (char* at = static_cast<char*>(to); size > 0;) {
        const ssize_t got = read(line, at, size);
        if (got <= 0) return false;
        at += got, size -= static_cast<std::size_t>(got);
    }
    return true;
}

inline bool write_frame(int line, std::uint8_t type, const std::vector<char>& payload) {
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

inline double cross(Point a, Point b) { return a.x * b.y - a.y * b.x; }
inline Point operator-(Point a, Point b) { return {a.x - b.x, a.y - b.y}; }
inline Point placed(Point p, const Pose& at) {
    const double c = std::cos(at.heading), s = std::sin(at.heading);
    return {at.x + p.x * c - p.y * s, at.y + p.x * s + p.y * c};
}

inline std::vector<Segment> edges(const std::vector<Point>& outline, const Pose& at) {
    std::vector<Segment> found;
    for (std::size_t i = 0; i < outline.size(); ++i)
        found.push_back({placed(outline[i], at), placed(outline[(i + 1) % outline.size()], at)});
    return found;
}

inline std::vector<Segment> outline_of(const Thing& thing) {
    const double l = thing.length / 2, w = thing.width / 2;
    return edges({{l, w}, {-l, w}, {-l, -w}, {l, -w}}, {thing.x, thing.y, thing.heading, 0});
}

inline Pose pose_of(Reader& in) {
    Pose p;
    p.x = in.take<double>(), p.y = in.take<double>(), p.heading = in.take<double>(), p.z = in.take<double>();
    return p;
}

// What Hello says of the robot: metres, kilograms, newton metres, radians.
struct Sizes {
    double step_s, track, radius, low, high, mass, wheel_mass, torque, ring, range, cone;
    std::vector<Point> hull;
    std::vector<Pose> sonar;

    explicit Sizes(Reader& in) {
        if (in.take<std::uint16_t>() != 1) throw std::runtime_error("this body speaks version 1");
        step_s = in.take<std::uint32_t>() / 1e9;
        in.text();
        for (double* value : {&track, &radius, &low, &high, &mass, &wheel_mass, &torque, &ring, &range}) *value = in.take<double>();
        radius /= 2;
        in.take<double>(), cone = in.take<double>();
        for (int n = in.take<std::uint16_t>(); n-- > 0;) {
            const double x = in.take<double>();
            hull.push_back({x, in.take<double>()});
        }
        for (int n = in.take<std::uint16_t>(); n-- > 0;) {
            Pose p;
            p.x = in.take<double>(), p.y = in.take<double>(), p.heading = in.take<double>();
            sonar.push_back(p);
        }
    }
};

// The things, as they stand in the plan, and walls that the scenario does not know.
class Plan {
public:
    std::vector<Thing> things;
    std::vector<Segment> walls;

    Thing& place(Reader& in) {
        Thing t{in.text(), in.take<std::uint8_t>(), 0, 0, 0, 0, 0, 0, 0, 0, 0, 0};
        for (double* value : {&t.x, &t.y, &t.heading, &t.length, &t.width, &t.radius, &t.base, &t.height, &t.mass, &t.friction})
            *value = in.take<double>();
        things.push_back(t);
        return things.back();
    }
    Thing& move(Reader& in) {
        Thing& t = find(in.text());
        t.x = in.take<double>(), t.y = in.take<double>(), t.heading = in.take<double>();
        return t;
    }
    Thing& find(const std::string& name) {
        for (Thing& t : things)
            if (t.name == name) return t;
        throw std::runtime_error("there is no " + name);
    }
    void remove(const std::string& name) {
        find(name);
        things.erase(std::remove_if(things.begin(), things.end(), [&](const Thing& t) { return t.name == name; }),
                      things.end());
    }

    // What a ray in the plane of the sonar ring meets within `longest` metres.
    Hit cast(Point from, double heading, double longest, double ring) const {
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
        for (const Segment& wall : walls) meet(wall);
        for (const Thing& t : things) {
            if (t.kind > 1 || t.base > ring || t.base + t.height < ring) continue;
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

    // Answer AskRanges and AskRays of a robot at a pose.
    void ranges(Reader& in, Writer& out, const Sizes& sizes, const Pose& pose) const {
        const auto count = in.take<std::uint16_t>();
        out.put(count);
        for (int n = 0; n < count; ++n) {
            const Pose& sonar = sizes.sonar.at(in.take<std::uint16_t>());
            const Point from = placed({sonar.x, sonar.y}, pose);
            double nearest = kInfinity;
            for (int ray = 0; ray < kRaysPerSonar; ++ray) {
                const double aside = sizes.cone / 2 * (2.0 * ray / (kRaysPerSonar - 1) - 1);
                nearest = std::min(nearest, cast(from, pose.heading + sonar.heading + aside, sizes.range, sizes.ring).distance);
            }
            out.put(nearest);
        }
    }
    void rays(Reader& in, Writer& out, const Sizes& sizes, const Pose& pose) const {
        const double longest = in.take<double>();
        const auto count = in.take<std::uint32_t>();
        out.put(count);
        for (std::uint32_t n = 0; n < count; ++n) {
            const double x = in.take<double>(), y = in.take<double>(), heading = in.take<double>();
            const Hit hit = cast(placed({x, y}, pose), pose.heading + heading, longest, sizes.ring);
            out.put(hit.distance).put(hit.cosine);
        }
    }
};

// The steps ---------------------------------------------------------------------------------

// What a step has come to: angles of the wheels, rad, the bits, and with kTouches what the hull touches, and where.
struct Stepped {
    double left = 0, right = 0;
    std::uint8_t bits = 0;
    Point where{0, 0};
    std::string what{};
};

// The bit of a wheel that hardly turns, m/s at its rim, and falls short of what it was asked for.
inline std::uint8_t stalled(std::uint8_t bit, double asked, double rim) {
    return std::fabs(rim) < 0.05 && std::fabs(asked - rim) > 0.05 * std::fabs(asked) ? bit : 0;
}

// Answer Step: make each by `step(left, right, is_powered)`, then tell `report(out)` and the things that have `moved()`.
// A touch is reported where it begins; return whether the last step touches.
template <typename Step, typename Report, typename Moved>
bool make_steps(Reader& in, Writer& out, bool touching, Step step, Report report, Moved moved) {
    const auto steps = in.take<std::uint32_t>();
    Writer touched;
    std::uint16_t touches = 0;
    out.put(steps);
    for (std::uint32_t n = 0; n < steps; ++n) {
        const double left = in.take<double>(), right = in.take<double>();
        const Stepped made = step(left, right, in.take<std::uint8_t>() != 0);
        if ((made.bits & kTouches) && !touching)
            touched.put(n).put(made.where.x).put(made.where.y).text(made.what), ++touches;
        touching = made.bits & kTouches;
        out.put(made.left).put(made.right).put(made.bits);
    }
    report(out);
    out.put(touches);
    out.data.insert(out.data.end(), touched.data.begin(), touched.data.end());
    const std::vector<Thing> pushed = moved();
    out.put(static_cast<std::uint16_t>(pushed.size()));
    for (const Thing& t : pushed) out.text(t.name).put(t.x).put(t.y).put(t.heading);
    return touching;
}

// Answer each request of a connection that begins with Hello.
template <typename Body> void serve(int line, Body& body) {
    bool greeted = false;
    for (std::uint32_t size; read_all(line, &size, sizeof size); greeted = true) {
        std::uint8_t type;
        if (!read_all(line, &type, 1)) return;
        if (!greeted && (type != kHello || size > kLongestHello)) {
            std::fputs("connection refused: it begins with no Hello\n", stderr);
            return;
        }
        if (size < 1 || size > kLongestFrame) return;
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
inline int listen_at(const std::string& address) {
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

// Serve bodies at an address, each made by `make`, until a signal; return what the program ends with.
template <typename Make> int run(const char* address, Make make) {
    std::signal(SIGPIPE, SIG_IGN);
    std::signal(SIGCHLD, SIG_IGN);
    std::signal(SIGINT, [](int) { _exit(130); });
    const int listener = listen_at(address);
    if (listener < 0) {
        std::fprintf(stderr, "cannot listen on %s\n", address);
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
            auto body = make();
            serve(line, *body);
            _exit(0);
        }
        close(line);
    }
}

}  // namespace lock_step
