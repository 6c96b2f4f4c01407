// A body for p2os in another program: Gazebo Harmonic (gz-sim 8), nothing of p2os. UNTRIED: compiled against Gazebo's
// headers, never linked or run.
//
//   sudo apt-get install libgz-sim8-dev                from Gazebo's own packages
//   cmake -B build . && cmake --build build            with lock_step.hpp beside it
//   p2os world convert room --out room.sdf
//   build/gazebo_body unix:/tmp/body room.sdf          then: p2os run dodge --body unix:/tmp/body
//
// The server stands in this program and is run by one iteration a step. Things that the world's file does not have are
// added; without a file there is a floor alone. Rays are cast in the plan, where meshes and what only the file has are
// not seen. It does not save. Wheels without power are braked.
#include <gz/msgs/contacts.pb.h>

#include <gz/sim/EntityComponentManager.hh>
#include <gz/sim/Joint.hh>
#include <gz/sim/Link.hh>
#include <gz/sim/Model.hh>
#include <gz/sim/SdfEntityCreator.hh>
#include <gz/sim/Server.hh>
#include <gz/sim/System.hh>
#include <gz/sim/Util.hh>
#include <gz/sim/components/AngularVelocityCmd.hh>
#include <gz/sim/components/ContactSensorData.hh>
#include <gz/sim/components/LinearVelocityCmd.hh>
#include <gz/sim/components/Model.hh>
#include <gz/sim/components/Name.hh>
#include <gz/sim/components/Physics.hh>
#include <sdf/Root.hh>

#include <memory>
#include <optional>
#include <sstream>

#include "lock_step.hpp"

namespace {

using namespace lock_step;
namespace sim = gz::sim;
using gz::math::Pose3d;
using gz::math::Vector3d;

constexpr double kCasterM = 0.03, kBehindM = 0.02, kMovedM = 1e-4;
constexpr int kSettleSteps = 300;
const char kFloorAlone[] =
    "<sdf version='1.9'><world name='p2os'><model name='ground'><static>1</static><link name='l'><collision name='c'>"
    "<geometry><plane/></geometry></collision><visual name='v'><geometry><plane><size>20 20</size></plane></geometry>"
    "</visual></link></model></world></sdf>";

template <typename... Words> std::string text(const Words&... words) {
    std::ostringstream out;
    out.precision(17);
    (out << ... << words);
    return out.str();
}

std::string pose_tag(double x, double y, double z, double heading = 0) {
    return text("<pose>", x, ' ', y, ' ', z, " 0 0 ", heading, "</pose>");
}

std::string sphere(double radius) { return text("<sphere><radius>", radius, "</radius></sphere>"); }

std::string box(double x, double y, double z) { return text("<box><size>", x, ' ', y, ' ', z, "</size></box>"); }

// A shape that is felt and seen.
std::string shape(const std::string& name, const std::string& geometry, double friction, const std::string& pose = "") {
    const std::string form = text(" name='", name, "'>", pose, "<geometry>", geometry, "</geometry>");
    return text("<collision", form, "<surface><friction><ode><mu>", friction, "</mu><mu2>", friction,
                "</mu2></ode></friction></surface></collision><visual", form, "</visual>");
}

// The inertia of a solid box.
std::string inertia(double mass, const Vector3d& size, const std::string& pose = "") {
    const auto about = [&](double a, double b) { return mass / 12 * (a * a + b * b); };
    return text("<inertial>", pose, "<mass>", mass, "</mass><inertia><ixx>", about(size.Y(), size.Z()), "</ixx><iyy>",
                about(size.X(), size.Z()), "</iyy><izz>", about(size.X(), size.Y()),
                "</izz><ixy>0</ixy><ixz>0</ixz><iyz>0</iyz></inertia></inertial>");
}

// The robot: its frame is the middle of the axle, on the floor.
std::string robot_of(const Sizes& s) {
    double front = 0, rear = 0, half = 0;
    for (const Point& p : s.hull) front = std::max(front, p.x), rear = std::min(rear, p.x), half = std::max(half, p.y);
    const Vector3d size(front - rear, 2 * half, s.high - s.low);
    std::string found = text("<link name='hull'>", inertia(s.mass - 2 * s.wheel_mass, size, pose_tag(-kBehindM, 0, s.radius)),
                             shape("hull", box(size.X(), size.Y(), size.Z()), 0.3,
                                   pose_tag((front + rear) / 2, 0, (s.low + s.high) / 2)),
                             shape("caster", sphere(kCasterM), 0, pose_tag(rear * 0.7, 0, kCasterM)), "</link>");
    const double edge = s.radius * std::sqrt(2.4);  // a box of this edge turns like the ball
    for (const char* side : {"left", "right"})
        found += text("<link name='", side, "'>", pose_tag(0, *side == 'l' ? s.track / 2 : -s.track / 2, s.radius),
                      inertia(s.wheel_mass, {edge, edge, edge}), shape("wheel", sphere(s.radius), 0.8), "</link><joint name='",
                      side, " axle' type='revolute'><parent>hull</parent><child>", side,
                      "</child><axis><xyz>0 1 0</xyz><limit><effort>", s.torque, "</effort></limit></axis></joint>");
    return found;
}

// Gazebo gives its entities to systems alone; nothing changes them while the server is not run.
struct Access : sim::System, sim::ISystemConfigure {
    void Configure(const sim::Entity& of, const std::shared_ptr<const sdf::Element>&, sim::EntityComponentManager& entities,
                   sim::EventManager& events) override {
        world = of, ecm = &entities, creator.emplace(entities, events);
    }
    sim::Entity world = sim::kNullEntity;
    sim::EntityComponentManager* ecm = nullptr;
    std::optional<sim::SdfEntityCreator> creator;
};

class Body {
public:
    explicit Body(std::string file) : file_(std::move(file)) {}

    // Answer a request; throws where it cannot be.
    std::vector<char> answer(std::uint8_t type, Reader in) {
        Writer out;
        switch (type) {
            case kHello: sizes_.emplace(in), out.put<std::uint16_t>(1).put<std::uint16_t>(kCastsRays).text("Gazebo")
                             .text("rays see neither meshes nor what only the world's file has"); break;
            case kMakeWorld: in.text(), pose_of(in), make_world(); break;
            case kPlace: place(plan_.place(in)); break;
            case kPlaceMesh: place_mesh(in); break;
            case kMove: move(plan_.move(in)); break;
            case kRemove: remove(in.text()); break;
            case kReset: stand(pose_of(in)), in.take<std::uint64_t>(), zero(), report(out); break;
            case kStandAt: stand(pose_of(in)), report(out); break;
            case kStep: step(in, out); break;
            case kAskRanges: moved(), plan_.ranges(in, out, *sizes_, pose()); break;
            case kAskRays: moved(), plan_.rays(in, out, *sizes_, pose()); break;
            case kBye: break;
            default: throw std::runtime_error("Gazebo does not save here");
        }
        in.end();
        return out.data;
    }

private:
    sim::EntityComponentManager& ecm() const { return *access_->ecm; }

    void make_world() {
        server_.reset(), plan_.things.clear();
        sim::ServerConfig config;
        if (file_.empty()) config.SetSdfString(kFloorAlone);
        else config.SetSdfFile(file_);
        config.SetUpdateRate(1e9);  // as fast as it can: the bench has the clock
        server_ = std::make_unique<sim::Server>(config);
        access_ = std::make_shared<Access>();
        server_->AddSystem(access_);
        if (access_->ecm == nullptr) throw std::runtime_error("Gazebo cannot read " + file_);
        const auto* physics = ecm().Component<sim::components::Physics>(access_->world);
        if (physics == nullptr || std::fabs(physics->Data().MaxStepSize() - sizes_->step_s) > 1e-12)
            throw std::runtime_error(text("the world's max_step_size has to be ", sizes_->step_s));
        robot_ = sim::Model(spawn("robot", robot_of(*sizes_)));
        hull_ = sim::Link(robot_.LinkByName(ecm(), "hull"));
        hull_.EnableVelocityChecks(ecm());
        shell_ = hull_.CollisionByName(ecm(), "hull");
        ecm().CreateComponent(shell_, sim::components::ContactSensorData());
        for (int side = 0; side < 2; ++side) {
            axles_[side] = sim::Joint(robot_.JointByName(ecm(), side == 0 ? "left axle" : "right axle"));
            axles_[side].EnablePositionCheck(ecm()), axles_[side].EnableVelocityCheck(ecm());
        }
    }

    // Make a model of what stands within <model>; its name may have any character.
    sim::Entity spawn(const std::string& name, const std::string& inside) {
        sdf::Root root;
        const auto errors = root.LoadSdfString("<sdf version='1.9'><model name='m'>" + inside + "</model></sdf>");
        if (root.Model() == nullptr) throw std::runtime_error(errors.empty() ? "no model" : errors[0].Message());
        const sim::Entity made = access_->creator->CreateEntities(root.Model());
        access_->creator->SetParent(made, access_->world);
        ecm().SetComponentData<sim::components::Name>(made, name);
        return made;
    }

    sim::Entity find(const std::string& name) const {
        return ecm().EntityByComponents(sim::components::Model(), sim::components::Name(name));
    }

    void place(const Thing& t) {
        if (find(t.name) != sim::kNullEntity) return;  // it stands in the file
        if (t.kind > 1) throw std::runtime_error("there are ramps in the world's file alone");
        const std::string geometry = t.kind == 0 ? box(t.length, t.width, t.height)
                                                 : text("<cylinder><radius>", t.radius, "</radius><length>", t.height,
                                                        "</length></cylinder>");
        const double round = std::sqrt(3.0) * t.radius;  // a box of this edge turns like the cylinder
        const Vector3d size = t.kind == 0 ? Vector3d(t.length, t.width, t.height) : Vector3d(round, round, t.height);
        spawn(t.name, text(pose_tag(t.x, t.y, t.base + t.height / 2, t.heading), "<static>", t.mass > 0 ? 0 : 1,
                           "</static><link name='l'>", t.mass > 0 ? inertia(t.mass, size) : "",
                           shape("c", geometry, t.friction), "</link>"));
    }

    void place_mesh(Reader& in) {
        const std::string name = in.text();
        for (std::uint32_t n = in.take<std::uint32_t>(); n-- > 0;)
            in.take<double>(), in.take<double>(), in.take<double>();
        for (std::uint32_t n = 3 * in.take<std::uint32_t>(); n-- > 0;) in.take<std::uint32_t>();
        if (find(name) == sim::kNullEntity) throw std::runtime_error("the world's file has to have the mesh " + name);
    }

    void move(const Thing& t) {
        sim::Model(find(t.name)).SetWorldPoseCmd(ecm(), Pose3d(t.x, t.y, t.base + t.height / 2, 0, 0, t.heading));
    }

    void remove(const std::string& name) {
        plan_.remove(name);
        access_->creator->RequestRemoveEntity(find(name));
        server_->RunOnce(true);  // paused: what is removed goes, and no time passes
    }

    // Stand still with the middle of the axle at a place.
    void stand(const Pose& p) {
        robot_.SetWorldPoseCmd(ecm(), Pose3d(p.x, p.y, p.z, 0, 0, p.heading));
        hull_.SetLinearVelocity(ecm(), Vector3d::Zero), hull_.SetAngularVelocity(ecm(), Vector3d::Zero);
        go(0, 0);
        // As long as these are there, Gazebo holds the hull still.
        ecm().RemoveComponent<sim::components::LinearVelocityCmd>(hull_.Entity());
        ecm().RemoveComponent<sim::components::AngularVelocityCmd>(hull_.Entity());
        for (int n = 0; n < kSettleSteps; ++n) go(0, 0);
        touching_ = false;
    }

    void zero() {
        for (int side = 0; side < 2; ++side) zero_[side] += angle(side);
    }

    void go(double left, double right) {
        axles_[0].SetVelocity(ecm(), {left / sizes_->radius}), axles_[1].SetVelocity(ecm(), {right / sizes_->radius});
        server_->Run(true, 1, false);
    }

    static double first(const std::optional<std::vector<double>>& values) {
        if (!values || values->empty()) throw std::runtime_error("no physics runs in this world of Gazebo");
        return values->front();
    }
    double angle(int side) const { return first(axles_[side].Position(ecm())) - zero_[side]; }
    double rim(int side) const { return first(axles_[side].Velocity(ecm())) * sizes_->radius; }

    Pose pose() const {
        const Pose3d where = sim::worldPose(robot_.Entity(), ecm());
        return {where.X(), where.Y(), where.Yaw(), where.Z()};
    }

    void report(Writer& out) const {
        const Pose p = pose();
        const Vector3d v = hull_.WorldLinearVelocity(ecm()).value_or(Vector3d::Zero);
        const double turn = hull_.WorldAngularVelocity(ecm()).value_or(Vector3d::Zero).Z();
        const double nose_up = -sim::worldPose(robot_.Entity(), ecm()).Pitch();
        for (double value : {p.x, p.y, p.z, p.heading, nose_up, angle(0), angle(1), rim(0), rim(1),
                             v.X() * std::cos(p.heading) + v.Y() * std::sin(p.heading), turn, -1.0, 0.0})
            out.put(value);
    }

    void step(Reader& in, Writer& out) {
        const auto one = [&](double left, double right, bool is_powered) {
            if (!is_powered) left = right = 0;
            go(left, right);
            Stepped made{angle(0), angle(1)};
            // A commanded joint has its speed after one step, unless its torque does not suffice.
            made.bits = stalled(kStalledLeft, left, rim(0)) | stalled(kStalledRight, right, rim(1));
            Vector3d where;
            if (touch(&where, &made.what)) made.bits |= kTouches, made.where = {where.X(), where.Y()};
            return made;
        };
        touching_ = make_steps(in, out, touching_, one, [&](Writer& to) { report(to); }, [&] { return moved(); });
    }

    // Whether the hull touches something but the floor, where, and what.
    bool touch(Vector3d* where, std::string* name) const {
        const auto* data = ecm().Component<sim::components::ContactSensorData>(shell_);
        for (const gz::msgs::Contact& contact : data->Data().contact()) {
            *name = sim::Model(sim::topLevelModel(contact.collision2().id(), ecm())).Name(ecm());
            if (*name == "ground" || contact.position_size() == 0) continue;
            where->Set(contact.position(0).x(), contact.position(0).y(), contact.position(0).z());
            return true;
        }
        return false;
    }

    // Take over where what can be pushed stands; return what has moved.
    std::vector<Thing> moved() {
        std::vector<Thing> found;
        for (Thing& t : plan_.things) {
            if (t.mass <= 0) continue;
            const Pose3d now = sim::worldPose(find(t.name), ecm());
            if (std::hypot(now.X() - t.x, now.Y() - t.y) <= kMovedM) continue;
            t.x = now.X(), t.y = now.Y(), t.heading = now.Yaw();
            found.push_back(t);
        }
        return found;
    }

    std::string file_;
    Plan plan_;
    std::optional<Sizes> sizes_;
    std::shared_ptr<Access> access_;
    std::unique_ptr<sim::Server> server_;
    sim::Model robot_;
    sim::Link hull_;
    sim::Joint axles_[2];
    sim::Entity shell_ = sim::kNullEntity;
    double zero_[2] = {};
    bool touching_ = false;
};

}  // namespace

int main(int argc, char** argv) {
    if (argc < 2 || argc > 3) {
        std::fprintf(stderr, "usage: gazebo_body unix:PATH|tcp:127.0.0.1:PORT [WORLD.sdf]\n");
        return 2;
    }
    return run(argv[1], [&] {
        // Each connection's server for itself, and on this machine alone.
        setenv("GZ_PARTITION", ("p2os_" + std::to_string(getpid())).c_str(), 0);
        setenv("GZ_IP", "127.0.0.1", 0);
        return std::make_unique<Body>(argc == 3 ? argv[2] : "");
    });
}
