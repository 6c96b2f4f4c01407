// A body for p2os in another program: a differential drive in a plan view, with walls of its own.
//
//   g++ -std=c++17 -O2 -o plan_view plan_view.cpp      with lock_step.hpp beside it
//   ./plan_view unix:/tmp/body --wall 2,-1,2,1        then: p2os run dodge --body unix:/tmp/body
//
// It needs no library. Each connection is a process of its own, so that forks of a bench have bodies of their own. Not
// modelled: masses (what can be pushed stands fast), slopes, meshes.
#include <memory>
#include <optional>

#include "lock_step.hpp"

using namespace lock_step;

namespace {

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

bool is_inside(Point p, const std::vector<Segment>& outline) {
    return std::all_of(outline.begin(), outline.end(), [&](const Segment& e) { return cross(e.b - e.a, p - e.a) >= 0; });
}

// The robot ---------------------------------------------------------------------------------

struct Motion {  // all that decides the future, beside the things: what is saved
    Pose pose;
    double left = 0, right = 0, left_mps = 0, right_mps = 0;
    std::uint64_t bits = 0;  // as wide as the rest, so that nothing between is undefined
};

class Body {
public:
    explicit Body(std::vector<Segment> walls) { plan_.walls = std::move(walls); }

    // Answer a request; throws where it cannot be.
    std::vector<char> answer(std::uint8_t type, Reader in) {
        Writer out;
        switch (type) {
            case kHello: sizes_.emplace(in), out.put<std::uint16_t>(1).put<std::uint16_t>(kSaves | kCastsRays | kRolls)
                             .text("plan_view").text(""); break;
            case kMakeWorld: plan_.things.clear(), in.text(), pose_of(in); break;  // the floor is endless here
            case kPlace: plan_.place(in); break;
            case kMove: plan_.move(in); break;
            case kRemove: plan_.remove(in.text()); break;
            case kReset: motion_ = {}, motion_.pose = pose_of(in), in.take<std::uint64_t>(), report(out); break;
            case kStandAt: motion_.pose = pose_of(in), motion_.left_mps = motion_.right_mps = 0, report(out); break;
            case kStep: step(in, out); break;
            case kAskRanges: plan_.ranges(in, out, *sizes_, motion_.pose); break;
            case kAskRays: plan_.rays(in, out, *sizes_, motion_.pose); break;
            case kSave: out.put<std::uint32_t>(sizeof motion_).put(motion_); break;
            case kRestore: restore(in), report(out); break;
            case kBye: break;
            default: throw std::runtime_error(type == kPlaceMesh ? "a plan view of this kind has no meshes" : "what is that");
        }
        in.end();
        return out.data;
    }

private:
    void restore(Reader& in) {
        if (in.take<std::uint32_t>() != sizeof motion_) throw std::runtime_error("this is no state of mine");
        motion_ = in.take<Motion>();
    }

    // How far the hull at a pose is from the nearest thing, metres; 0 in contact; the thing's name.
    double clearance(const Pose& at, std::string* name) const {
        const std::vector<Segment> hull = edges(sizes_->hull, at);
        double nearest = 1e6;
        const auto take = [&](double far, const std::string& of) {
            if (far < nearest) nearest = far, *name = of;
        };
        const auto take_segment = [&](const Segment& wall, const std::string& of) {
            for (const Segment& e : hull) take(distance(e, wall), of);
            if (is_inside(wall.a, hull)) take(0, of);
        };
        for (const Segment& wall : plan_.walls) take_segment(wall, "own wall");
        for (const Thing& t : plan_.things) {
            if (t.kind > 1 || t.base >= sizes_->high || t.base + t.height <= sizes_->low) continue;
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

    void report(Writer& out) const {
        std::string name;
        const Motion& m = motion_;
        for (double value : {m.pose.x, m.pose.y, m.pose.z, std::remainder(m.pose.heading, 2 * M_PI), 0.0, m.left, m.right,
                             m.left_mps, m.right_mps, (m.left_mps + m.right_mps) / 2, (m.right_mps - m.left_mps) / sizes_->track,
                             clearance(m.pose, &name), 0.0})
            out.put(value);
    }

    void step(Reader& in, Writer& out) {
        const auto one = [&](double left, double right, bool) {
            std::string name;
            go(left, right, &name);
            const Motion& m = motion_;
            return Stepped{m.left, m.right, static_cast<std::uint8_t>(m.bits), {m.pose.x, m.pose.y}, name};
        };
        make_steps(in, out, motion_.bits & kTouches, one, [&](Writer& to) { report(to); },
                   [] { return std::vector<Thing>(); });  // nothing is pushed
    }

    // Move on by one step along the exact arc, or stall where that leads into a thing.
    void go(double left, double right, std::string* name) {
        Motion next = motion_;
        const double forward = (left + right) / 2 * sizes_->step_s, turn = (right - left) / sizes_->track * sizes_->step_s;
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
            return;
        }
        std::string there;
        if (clearance(p, name) == 0 && clearance(motion_.pose, &there) > 0) {
            motion_.left_mps = motion_.right_mps = 0;
            motion_.bits = kTouches | (left != 0 ? kStalledLeft : 0) | (right != 0 ? kStalledRight : 0);
            return;
        }
        next.left += left * sizes_->step_s / sizes_->radius, next.right += right * sizes_->step_s / sizes_->radius;
        next.left_mps = left, next.right_mps = right, next.bits = 0;
        motion_ = next;
    }

    Plan plan_;
    std::optional<Sizes> sizes_;
    Motion motion_;
};

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
    return run(argv[1], [&] { return std::make_unique<Body>(walls); });
}
