// A body for p2os in another program: DART's dynamics (https://dartsim.github.io), nothing of p2os.
//
//   sudo apt-get install libdart-dev libdart-external-ikfast-dev
//   g++ -O2 -o dart_body dart_body.cpp $(pkg-config --cflags --libs dart) -std=c++17    with lock_step.hpp beside it
//   ./dart_body unix:/tmp/body                         then: p2os run dodge --body unix:/tmp/body
//
// It saves: the future is in positions and velocities alone. Its rays are cast in the plan. A cylinder is a star of
// boxes, for DART's own collision detector has none against boxes. Not modelled: ramps, meshes; wheels without power
// are braked.
#include <dart/dart.hpp>

#include <map>
#include <memory>
#include <optional>

#include "lock_step.hpp"

using namespace lock_step;
using namespace dart::dynamics;

namespace {

constexpr double kCasterM = 0.03, kFloorM = 200, kBehindM = 0.02, kMovedM = 1e-4;
constexpr int kSettleSteps = 300, kStar = 8;

Eigen::Isometry3d at(double x, double y, double z, double heading = 0) {
    Eigen::Isometry3d where = Eigen::Isometry3d::Identity();
    where.translation() << x, y, z;
    where.rotate(Eigen::AngleAxisd(heading, Eigen::Vector3d::UnitZ()));
    return where;
}

void give_shape(BodyNode* body, const ShapePtr& shape, const Eigen::Isometry3d& where, double friction) {
    auto* node = body->createShapeNodeWith<CollisionAspect, DynamicsAspect>(shape);
    node->setRelativeTransform(where);
    node->getDynamicsAspect()->setFrictionCoeff(friction);
}

ShapePtr box(double x, double y, double z) { return std::make_shared<BoxShape>(Eigen::Vector3d(x, y, z)); }

class Body {
public:
    // Answer a request; throws where it cannot be.
    std::vector<char> answer(std::uint8_t type, Reader in) {
        Writer out;
        switch (type) {
            case kHello: sizes_.emplace(in), out.put<std::uint16_t>(1).put<std::uint16_t>(kSaves | kCastsRays).text("DART")
                             .text("ramps and meshes are refused"); break;
            case kMakeWorld: in.text(), pose_of(in), make_world(); break;
            case kPlace: place(plan_.place(in)); break;
            case kMove: move(plan_.move(in)); break;
            case kRemove: remove(in.text()); break;
            case kReset: stand(pose_of(in)), in.take<std::uint64_t>(), settle(), report(out); break;
            case kStandAt: stand(pose_of(in)), report(out); break;
            case kStep: step(in, out); break;
            case kAskRanges: moved(), plan_.ranges(in, out, *sizes_, pose()); break;
            case kAskRays: moved(), plan_.rays(in, out, *sizes_, pose()); break;
            case kSave: save(out); break;
            case kRestore: restore(in), report(out); break;
            case kBye: break;
            default: throw std::runtime_error(type == kPlaceMesh ? "DART has no meshes here" : "what is that");
        }
        in.end();
        return out.data;
    }

private:
    void make_world() {
        const Sizes& s = *sizes_;
        plan_.things.clear(), bodies_.clear();
        world_ = dart::simulation::World::create();
        world_->setGravity({0, 0, -9.81});
        world_->setTimeStep(s.step_s);
        world_->getConstraintSolver()->setCollisionDetector(dart::collision::DARTCollisionDetector::create());
        const SkeletonPtr floor = Skeleton::create("floor");
        floor_ = floor->createJointAndBodyNodePair<WeldJoint>().second;
        give_shape(floor_, box(kFloorM, kFloorM, 1), at(0, 0, -0.5), 1.0);
        world_->addSkeleton(floor);

        double front = 0, rear = 0, half = 0;
        for (const Point& p : s.hull) front = std::max(front, p.x), rear = std::min(rear, p.x), half = std::max(half, p.y);
        const Eigen::Vector3d size(front - rear, 2 * half, s.high - s.low);
        robot_ = Skeleton::create("robot");
        hull_ = robot_->createJointAndBodyNodePair<FreeJoint>().second;
        give_shape(hull_, box(size.x(), size.y(), size.z()), at((front + rear) / 2, 0, s.low + size.z() / 2), 0.3);
        Inertia inertia(s.mass - 2 * s.wheel_mass);
        inertia.setLocalCOM({-kBehindM, 0, s.radius});
        inertia.setMoment(BoxShape::computeInertia(size, inertia.getMass()));
        hull_->setInertia(inertia);
        BodyNode* caster = robot_->createJointAndBodyNodePair<WeldJoint>(hull_).second;
        caster->getParentJoint()->setTransformFromParentBodyNode(at(rear * 0.7, 0, kCasterM));
        give_shape(caster, std::make_shared<SphereShape>(kCasterM), Eigen::Isometry3d::Identity(), 0.0);
        caster->setMass(0.2);
        for (int side = 0; side < 2; ++side) {
            const auto [joint, wheel] = robot_->createJointAndBodyNodePair<RevoluteJoint>(hull_);
            joint->setAxis(Eigen::Vector3d::UnitY());
            joint->setTransformFromParentBodyNode(at(0, side == 0 ? s.track / 2 : -s.track / 2, s.radius));
            joint->setActuatorType(Joint::SERVO);
            joint->setForceLowerLimit(0, -s.torque), joint->setForceUpperLimit(0, s.torque);
            const auto ball = std::make_shared<SphereShape>(s.radius);
            give_shape(wheel, ball, Eigen::Isometry3d::Identity(), 0.8);
            Inertia round(s.wheel_mass);
            round.setMoment(ball->computeInertia(s.wheel_mass));
            wheel->setInertia(round);
            wheels_[side] = joint;
        }
        world_->addSkeleton(robot_);
    }

    void place(const Thing& t) {
        if (t.kind > 1) throw std::runtime_error("DART has no ramps here");
        const SkeletonPtr thing = Skeleton::create(t.name);
        BodyNode* body = t.mass > 0 ? thing->createJointAndBodyNodePair<FreeJoint>().second
                                    : thing->createJointAndBodyNodePair<WeldJoint>().second;
        if (t.kind == 0) give_shape(body, box(t.length, t.width, t.height), Eigen::Isometry3d::Identity(), t.friction);
        const double turn = M_PI / kStar;
        for (int n = 0; t.kind == 1 && n < kStar; ++n)
            give_shape(body, box(2 * t.radius * std::cos(turn / 2), 2 * t.radius * std::sin(turn / 2), t.height),
                       at(0, 0, 0, n * turn), t.friction);
        if (t.mass > 0) {
            Inertia inertia(t.mass);
            inertia.setMoment(body->getShapeNode(0)->getShape()->computeInertia(t.mass));
            body->setInertia(inertia);
        }
        bodies_[t.name] = body;
        move(t);
        world_->addSkeleton(thing);
    }

    void move(const Thing& t) {
        BodyNode* body = bodies_.at(t.name);
        const Eigen::Isometry3d where = at(t.x, t.y, t.base + t.height / 2, t.heading);
        if (t.mass > 0) FreeJoint::setTransform(body, where), body->getSkeleton()->resetVelocities();
        else body->getParentJoint()->setTransformFromParentBodyNode(where);
    }

    void remove(const std::string& name) {
        plan_.remove(name);
        world_->removeSkeleton(bodies_.at(name)->getSkeleton());
        bodies_.erase(name);
    }

    // Stand still with the middle of the axle at a place.
    void stand(const Pose& p) {
        FreeJoint::setTransform(hull_, at(p.x, p.y, p.z, p.heading));
        robot_->resetVelocities();
    }

    void settle() {
        for (RevoluteJoint* wheel : wheels_) wheel->setPosition(0, 0.0);
        for (int n = 0; n < kSettleSteps; ++n) go(0, 0);
        for (int side = 0; side < 2; ++side) zero_[side] = wheels_[side]->getPosition(0);
        touching_ = 0;
    }

    void go(double left, double right) {
        wheels_[0]->setCommand(0, left / sizes_->radius), wheels_[1]->setCommand(0, right / sizes_->radius);
        world_->step();
    }

    Pose pose() const {
        const Eigen::Isometry3d& where = hull_->getWorldTransform();
        Pose p;
        p.x = where.translation().x(), p.y = where.translation().y(), p.z = where.translation().z();
        p.heading = std::atan2(where(1, 0), where(0, 0));
        return p;
    }

    void report(Writer& out) const {
        const Pose p = pose();
        const Eigen::Vector3d v = hull_->getLinearVelocity();
        const double pitch = std::asin(std::clamp(hull_->getWorldTransform()(2, 0), -1.0, 1.0));
        for (double value : {p.x, p.y, p.z, p.heading, pitch, wheels_[0]->getPosition(0) - zero_[0],
                             wheels_[1]->getPosition(0) - zero_[1], wheels_[0]->getVelocity(0) * sizes_->radius,
                             wheels_[1]->getVelocity(0) * sizes_->radius,
                             v.x() * std::cos(p.heading) + v.y() * std::sin(p.heading), hull_->getAngularVelocity().z(), -1.0, 0.0})
            out.put(value);
    }

    void step(Reader& in, Writer& out) {
        const auto one = [&](double left, double right, bool is_powered) {
            if (!is_powered) left = right = 0;
            go(left, right);
            Stepped made{wheels_[0]->getPosition(0) - zero_[0], wheels_[1]->getPosition(0) - zero_[1]};
            // A servo has its speed after one step, unless its torque does not suffice.
            made.bits = stalled(kStalledLeft, left, wheels_[0]->getVelocity(0) * sizes_->radius) |
                        stalled(kStalledRight, right, wheels_[1]->getVelocity(0) * sizes_->radius);
            Eigen::Vector3d where;
            if (const BodyNode* other = touch(&where))
                made.bits |= kTouches, made.where = {where.x(), where.y()}, made.what = other->getSkeleton()->getName();
            return made;
        };
        touching_ = make_steps(in, out, touching_ != 0, one, [&](Writer& to) { report(to); }, [&] { return moved(); });
    }

    // What the hull touches, and where; nothing for the floor.
    const BodyNode* touch(Eigen::Vector3d* where) const {
        for (const auto& contact : world_->getLastCollisionResult().getContacts()) {
            const BodyNode* one = contact.collisionObject1->getShapeFrame()->asShapeNode()->getBodyNodePtr();
            const BodyNode* other = contact.collisionObject2->getShapeFrame()->asShapeNode()->getBodyNodePtr();
            if (other == hull_) std::swap(one, other);
            if (one != hull_ || other == floor_) continue;
            *where = contact.point;
            return other;
        }
        return nullptr;
    }

    // Take over where what can be pushed stands; return what has moved.
    std::vector<Thing> moved() {
        std::vector<Thing> found;
        for (Thing& t : plan_.things) {
            if (t.mass <= 0) continue;
            const Eigen::Isometry3d& now = bodies_.at(t.name)->getWorldTransform();
            if (std::hypot(now.translation().x() - t.x, now.translation().y() - t.y) <= kMovedM) continue;
            t.x = now.translation().x(), t.y = now.translation().y(), t.heading = std::atan2(now(1, 0), now(0, 0));
            found.push_back(t);
        }
        return found;
    }

    // The robot, then what can be pushed by its name: positions, velocities.
    std::vector<SkeletonPtr> moving() const {
        std::vector<SkeletonPtr> found{robot_};
        for (const auto& [name, body] : bodies_)
            if (body->getSkeleton()->getNumDofs() > 0) found.push_back(body->getSkeleton());
        return found;
    }

    void save(Writer& out) const {
        Writer state;
        for (const SkeletonPtr& one : moving())
            for (const Eigen::VectorXd& values : {one->getPositions(), one->getVelocities()})
                for (double value : values) state.put(value);
        state.put(zero_[0]).put(zero_[1]).put(touching_);
        out.put(static_cast<std::uint32_t>(state.data.size()));
        out.data.insert(out.data.end(), state.data.begin(), state.data.end());
    }

    void restore(Reader& in) {
        in.take<std::uint32_t>();
        for (const SkeletonPtr& one : moving()) {
            Eigen::VectorXd positions(one->getNumDofs()), velocities(one->getNumDofs());
            for (double& value : positions) value = in.take<double>();
            for (double& value : velocities) value = in.take<double>();
            one->setPositions(positions), one->setVelocities(velocities);
        }
        zero_[0] = in.take<double>(), zero_[1] = in.take<double>(), touching_ = in.take<std::uint64_t>();
    }

    Plan plan_;
    std::optional<Sizes> sizes_;
    dart::simulation::WorldPtr world_;
    SkeletonPtr robot_;
    BodyNode *hull_ = nullptr, *floor_ = nullptr;
    RevoluteJoint* wheels_[2] = {};
    std::map<std::string, BodyNode*> bodies_;
    double zero_[2] = {};
    std::uint64_t touching_ = 0;
};

}  // namespace

int main(int argc, char** argv) {
    if (argc != 2) {
        std::fprintf(stderr, "usage: dart_body unix:PATH|tcp:127.0.0.1:PORT\n");
        return 2;
    }
    return run(argv[1], [] { return std::make_unique<Body>(); });
}
