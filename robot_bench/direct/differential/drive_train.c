/* Two motors, their gears, the robot's mass and its battery over a step; drive_train.py and analog.py have the theory.

   Every expression keeps the order of its operations: results are the same on each machine. */
#include <math.h>

/* chosen: friction on both wheels is found by turns; each turn takes the rest down by the wheels' coupling, below 1. */
enum { TURNS = 50 };
/* chosen: where nothing brakes, no wheel comes to this speed, rad/s. */
static const double FREE_RADPS = 1e4;
/* chosen: a wheel's own speed counts from this difference to its motor on, as a part and as a speed of the rim. */
static const double HELD_SHARE = 0.1, HELD_MPS = 0.001;
static const double SECONDS_PER_HOUR = 3600.0;

/* Parts of a step, as a bridge has them. */
struct shares {
    double forward, reverse, brake;
};

struct train {
    double dt_s, ohm, drop_v, k, friction_nm, damping_nm_s, own, other;
    /* Speeds of the wheels now, rad/s. */
    double left_radps, right_radps;
    /* What became of the last step: mean speeds, mean currents of the windings, and out of the supply, A. */
    double mean_left, mean_right, left_a, right_a, supply_a;
};

struct aim {
    double rate_radps, torque_nm;
};

struct battery {
    double full_v, empty_v, capacity_ah, ohm, idle_a;
    double used_ah, volts;
};

static double at_least_0(double value)
{
    return value > 0.0 ? value : 0.0;
}

double battery_source_v(const struct battery *battery)
{
    double left = 1 - battery->used_ah / battery->capacity_ah;
    return left > 0.0 ? battery->empty_v + (battery->full_v - battery->empty_v) * left : 0.0;
}

void battery_give(struct battery *battery, double amperes, double span_s)
{
    battery->used_ah = at_least_0(battery->used_ah + amperes * span_s / SECONDS_PER_HOUR);
}

double train_supply_v(const struct train *train, const struct shares *left, const struct shares *right, double source_v,
                      double source_ohm, double idle_a)
{
    double conductance = (left->forward + left->reverse + right->forward + right->reverse) / train->ohm;
    double emf_a = train->k / train->ohm
                   * ((left->forward - left->reverse) * train->left_radps
                      + (right->forward - right->reverse) * train->right_radps);
    double lost_v = train->drop_v * conductance;
    return at_least_0((source_v - source_ohm * (idle_a - emf_a - lost_v)) / (1 + source_ohm * conductance));
}

/* Take the speeds to which a body has come. */
void train_take(struct train *train, const struct shares *left, const struct shares *right, double supply_v,
                double left_radps, double right_radps)
{
    double volts = at_least_0(supply_v - train->drop_v), k = train->k;
    double mean_l = (train->left_radps + left_radps) / 2, mean_r = (train->right_radps + right_radps) / 2;
    double along_l = left->forward - left->reverse, along_r = right->forward - right->reverse;
    double driven_l = left->forward + left->reverse, driven_r = right->forward + right->reverse;
    train->left_radps = left_radps;
    train->right_radps = right_radps;
    train->mean_left = mean_l;
    train->mean_right = mean_r;
    train->left_a = (along_l * volts - (driven_l + left->brake) * k * mean_l) / train->ohm;
    train->right_a = (along_r * volts - (driven_r + right->brake) * k * mean_r) / train->ohm;
    train->supply_a = ((driven_l + driven_r) * volts - k * (along_l * mean_l + along_r * mean_r)) / train->ohm;
}

static double within(double value, double most)
{
    value = -most > value ? -most : value;
    return most < value ? most : value;
}

/* Speeds with friction, from those without; the rest are the speeds that a torque of 1 N·m adds. */
static void rub(double most, double *left, double *right, double own_l, double own_r, double other)
{
    double whole = own_l * own_r - other * other, rub_l = 0.0, rub_r = 0.0;
    if (most == 0.0)
        return;
    if (fabs(own_r * *left - other * *right) < most * whole && fabs(own_l * *right - other * *left) < most * whole) {
        *left = *right = 0.0; /* it holds both */
        return;
    }
    for (int turn = 0; turn < TURNS; ++turn) {
        double before_l = rub_l, before_r = rub_r;
        rub_l = within(-(*left + other * rub_r) / own_l, most);
        rub_r = within(-(*right + other * rub_l) / own_r, most);
        if (rub_l == before_l && rub_r == before_r)
            break;
    }
    double after_l = *left + own_l * rub_l + other * rub_r, after_r = *right + other * rub_l + own_r * rub_r;
    /* What friction holds stands still, and does not creep by the rounding of floats. */
    *left = fabs(rub_l) < most ? 0.0 : after_l;
    *right = fabs(rub_r) < most ? 0.0 : after_r;
}

void train_step(struct train *train, const struct shares *left, const struct shares *right, double supply_v)
{
    double volts = at_least_0(supply_v - train->drop_v), k = train->k, dt = train->dt_s, pull = k / train->ohm;
    double along_l = left->forward - left->reverse, along_r = right->forward - right->reverse;
    double driven_l = left->forward + left->reverse, driven_r = right->forward + right->reverse;
    double torque_l = pull * volts * along_l, torque_r = pull * volts * along_r;
    double brake_l = pull * k * (driven_l + left->brake) + train->damping_nm_s;
    double brake_r = pull * k * (driven_r + right->brake) + train->damping_nm_s;
    /* (M + B dt/2) (after - before) = dt (torque - B before + friction) */
    double own_l = train->own + brake_l * dt / 2, own_r = train->own + brake_r * dt / 2, other = train->other;
    double scale = dt / (own_l * own_r - other * other);
    double push_l = torque_l - brake_l * train->left_radps, push_r = torque_r - brake_r * train->right_radps;
    double after_l = train->left_radps + scale * (own_r * push_l - other * push_r);
    double after_r = train->right_radps + scale * (own_l * push_r - other * push_l);
    rub(train->friction_nm, &after_l, &after_r, scale * own_r, scale * own_l, -scale * other);
    train_take(train, left, right, supply_v, after_l, after_r);
}

/* Where a motor drives its wheel in a step of a body that has the masses, and how hard. */
void train_aim(const struct train *train, const struct shares *shares, double supply_v, double speed, struct aim *aim)
{
    double volts = at_least_0(supply_v - train->drop_v), pull = train->k / train->ohm, most = train->friction_nm;
    double drive = pull * volts * (shares->forward - shares->reverse);
    double brake = pull * train->k * (shares->forward + shares->reverse + shares->brake) + train->damping_nm_s;
    *aim = (struct aim){0.0, most};
    if (speed == 0.0 && fabs(drive) <= most)
        return;
    double way = copysign(1.0, speed == 0.0 ? drive : speed), net = drive - most * way;
    aim->torque_nm = fabs(net - brake * speed);
    if (net * way > 0.0) {
        aim->rate_radps = brake != 0.0 ? net / brake : way * FREE_RADPS;
    } else if (fabs(drive) > most) { /* else friction and brake alone: it ends in rest */
        double back = drive + most * way;
        aim->rate_radps = brake != 0.0 ? back / brake : -way * FREE_RADPS;
    }
}

/* Begin a step of a body that takes speeds: the battery's volts under its load, and the mean speeds of the motors. */
void drive_begin(struct train *train, struct battery *battery, const struct shares *left, const struct shares *right)
{
    battery->volts =
        train_supply_v(train, left, right, battery_source_v(battery), battery->ohm, battery->idle_a);
    train_step(train, left, right, battery->volts);
}

/* A motor's speed, which is its wheel's where that is held. */
static double held(double asked, double real, double now, double radius_m)
{
    double apart = fabs(real - asked);
    return apart > HELD_SHARE * fabs(asked) && apart * radius_m > HELD_MPS ? real : now;
}

/* End such a step: the body was asked for speeds, and its wheels have turned by angles in it. */
void drive_end(struct train *train, double asked_l, double asked_r, double turned_l, double turned_r, double radius_m)
{
    train->left_radps = held(asked_l, turned_l / train->dt_s, train->left_radps, radius_m);
    train->right_radps = held(asked_r, turned_r / train->dt_s, train->right_radps, radius_m);
}
