/* Theory of operation
 *
 * What the sensors know. Each looks out over 30 degrees and says only whether
 * something is nearer than about 0.6 m. Together they see everything from -65 to
 * +65 degrees and straight to both sides, and nothing behind. Their place tells
 * how much an obstacle matters: at +-10 degrees it stands in the way, at +-30 it
 * would be passed too closely, at +-50 it is worth a wider berth, and at +-90 it
 * is passed already and only asks for less speed.
 *
 * What the robot needs. Its hull turns within 0.32 m of the axle's centre, the
 * rear corners farthest, and is 0.19 m to each side when it drives straight.
 * Steering away while something is still 0.6 m ahead leaves about 0.5 m beside
 * it; between two things it takes the middle, since the nearer one shows at a
 * smaller angle. So a turn on the spot has room wherever the robot got by driving.
 * Up to 0.6 s pass from an obstacle to the wheels (sonar two in 100 ms, the line,
 * sampling): 0.11 m at full speed, and 0.06 m of braking.
 *
 *   CRUISE   straight on while nothing, or as much on both sides, is at +-30 and +-50
 *   VEER     an arc away from the side that is worse at +-30 or +-50
 *   TURN     on the spot, when +-10 sees something: away from the heavier side, until
 *            +-10 and +-30 are clear or +-30 shows two sides of a gap with +-10 clear;
 *            also out of a passage that proves too narrow: things 0.9 m apart show at
 *            +-30 on both sides for 0.10 m of way, nearer ones longer
 *   BACK_OUT instead of a TURN where both sides are shut too and straight ground lies
 *            behind: as far as the encoders prove it free, then a long TURN
 *
 * Against going in circles. A turn soon after another keeps the other's side (a
 * corner would swing the robot to and fro), and the third of these is a long one.
 * Every BOLD_EVERY-th turn ends with +-10 clear, and every CONTRARY_EVERY-th goes
 * to the heavier side: two walls would throw the robot to and fro between them.
 *
 * A sensor counts as soon as it sees, and until it has been clear for
 * RELEASE_TICKS: a threshold grazed does not make the wheels chatter.
 */
#include "dodge_fsm.h"

#include <stdbool.h>

/* Motor codes; chosen: fast enough for 8 m in two minutes twice over. */
#define FAST 3 /* nothing in sight */
#define SLOW 2 /* something in sight, or backwards */
#define SPIN 2 /* 40 degrees/s */

#define RELEASE_TICKS 25 /* chosen: 0.25 s, 10 degrees of a turn */

/* Way: 2 a wheel step of 64.8 mm. Twist: 1 is 10.4 degrees. */
#define SOON_WAY 12        /* 0.39 m: a turn within it belongs to the turn before */
#define FUTILE_TURNS 3     /* chosen */
#define LONG_TWIST 14      /* 145 degrees */
#define FULL_TWIST 35      /* 360 degrees */
#define BOLD_EVERY 2       /* chosen, as the next: by the ground covered in simulated rooms */
#define CONTRARY_EVERY 7
#define NARROW_WAY 4       /* 0.13 m with something at both +-30: less than 0.85 m apart, or a long passage */
#define BACK_LEAST_WAY 6   /* 0.19 m: less is not worth it */
#define BACK_MOST_WAY 10   /* 0.32 m: enough to turn freely */
#define BACK_MARGIN_WAY 4  /* 0.13 m: two steps of the encoders, then line and brakes from SLOW */
#define STATE_MOST_TICKS 1200 /* 12 s, a full circle and a third: encoders that stand still must hold no state for ever */
#define STRAIGHT_TICKS 60  /* by then the arc before has died away on the line and in the ramp */

enum sensor {
    LEFT_90 = 1 << 0,
    LEFT_50 = 1 << 1,
    LEFT_30 = 1 << 2,
    LEFT_10 = 1 << 3,
    RIGHT_10 = 1 << 4,
    RIGHT_30 = 1 << 5,
    RIGHT_50 = 1 << 6,
    RIGHT_90 = 1 << 7,
};

#define FRONT (LEFT_10 | RIGHT_10)
#define AHEAD (LEFT_30 | FRONT | RIGHT_30)
#define LEFT_SHUT (LEFT_30 | LEFT_50)
#define RIGHT_SHUT (RIGHT_30 | RIGHT_50)

const char *const dodge_state_names[DODGE_STATES] = {
    [DODGE_CRUISE] = "CRUISE",
    [DODGE_VEER_LEFT] = "VEER_LEFT",
    [DODGE_VEER_RIGHT] = "VEER_RIGHT",
    [DODGE_TURN_LEFT] = "TURN_LEFT",
    [DODGE_TURN_RIGHT] = "TURN_RIGHT",
    [DODGE_BACK_OUT] = "BACK_OUT",
};

static uint8_t mirror(uint8_t seen)
{
    uint8_t mirrored = 0;
    for (int i = 0; i < DODGE_SENSORS; i++) {
        mirrored = (uint8_t)(mirrored | (seen >> i & 1) << (DODGE_SENSORS - 1 - i));
    }
    return mirrored;
}

/* How much the left side of `seen` matters to someone driving on: 0 to 3. */
static int left_danger(uint8_t seen)
{
    return seen & LEFT_10 ? 3 : seen & LEFT_30 ? 2 : seen & LEFT_50 ? 1 : 0;
}

/* How much there is on the left side of `seen`, nearer to the front counting more. */
static int left_weight(uint8_t seen)
{
    return (seen & LEFT_90 ? 1 : 0) + (seen & LEFT_50 ? 2 : 0) + (seen & LEFT_30 ? 3 : 0) + (seen & LEFT_10 ? 4 : 0);
}

static void update_seen(struct dodge *dodge, uint8_t sensors)
{
    for (int i = 0; i < DODGE_SENSORS; i++) {
        uint8_t bit = (uint8_t)(1 << i);
        if (sensors & bit) {
            dodge->seen |= bit;
            dodge->unseen_ticks[i] = 0;
        } else if (dodge->seen & bit && ++dodge->unseen_ticks[i] >= RELEASE_TICKS) {
            dodge->seen = (uint8_t)(dodge->seen & ~bit);
        }
    }
}

/* Something near the way on both sides. */
static bool is_shut(const struct dodge *dodge)
{
    return dodge->seen & LEFT_SHUT && dodge->seen & RIGHT_SHUT;
}

/* Something at +-30 degrees on both sides and nothing between. */
static bool is_gap(const struct dodge *dodge)
{
    return dodge->seen & LEFT_30 && dodge->seen & RIGHT_30 && !(dodge->seen & FRONT);
}

static void begin_turn(struct dodge *dodge, int32_t twist, int least_twist)
{
    dodge->state = dodge->turn_side > 0 ? DODGE_TURN_LEFT : DODGE_TURN_RIGHT;
    dodge->turn_twist = twist;
    dodge->least_twist = least_twist;
}

/* +1 (left) or -1 (right), away from the heavier side; as before where both weigh the same. */
static int lighter_side(const struct dodge *dodge)
{
    int left = left_weight(dodge->seen), right = left_weight(mirror(dodge->seen));
    return left > right ? -1 : right > left ? +1 : dodge->turn_side;
}

static void turn_away(struct dodge *dodge, int32_t way, int32_t twist, int least_twist)
{
    dodge->turns++;
    if (way - dodge->turn_way >= SOON_WAY) {
        dodge->futile_turns = 0;
        dodge->turn_side = lighter_side(dodge);
        if (dodge->turns % CONTRARY_EVERY == 0 && !is_shut(dodge)) {
            dodge->turn_side = -dodge->turn_side;
        }
    } else if (++dodge->futile_turns >= FUTILE_TURNS) {
        dodge->futile_turns = 0;
        least_twist = LONG_TWIST;
    }
    begin_turn(dodge, twist, least_twist);
}

/* Way that the hull can go back straight over ground it has just covered. */
static int32_t free_way_behind(const struct dodge *dodge, int32_t way)
{
    int32_t free_way = dodge->straight_ticks > STRAIGHT_TICKS ? way - dodge->ground_way - BACK_MARGIN_WAY : 0;
    return free_way < BACK_MOST_WAY ? free_way : BACK_MOST_WAY;
}

static void drive_on(struct dodge *dodge, int32_t way, int32_t twist)
{
    int left = left_danger(dodge->seen), right = left_danger(mirror(dodge->seen));
    bool is_narrow = dodge->gap_way >= NARROW_WAY;
    if (!(dodge->seen & FRONT) && !is_narrow) {
        dodge->state = left > right ? DODGE_VEER_RIGHT : right > left ? DODGE_VEER_LEFT : DODGE_CRUISE;
    } else if (is_shut(dodge) && free_way_behind(dodge, way) >= BACK_LEAST_WAY) {
        dodge->back_way = way - free_way_behind(dodge, way);
        dodge->state = DODGE_BACK_OUT;
    } else {
        turn_away(dodge, way, twist, is_narrow ? LONG_TWIST : 0);
    }
}

static bool is_overdue(const struct dodge *dodge)
{
    return dodge->state_ticks >= STATE_MOST_TICKS;
}

/* The cone ahead is free: of everything, or of what forbids passing between two things. */
static bool is_way_out(const struct dodge *dodge, int32_t turned)
{
    bool is_bold = dodge->turns % BOLD_EVERY == 0 || turned >= FULL_TWIST || is_overdue(dodge);
    return is_gap(dodge) || !(dodge->seen & (is_bold ? FRONT : AHEAD));
}

static void turn_on(struct dodge *dodge, int32_t way, int32_t twist)
{
    int32_t turned = (twist - dodge->turn_twist) * dodge->turn_side;
    bool is_far_enough = turned >= dodge->least_twist || is_overdue(dodge);
    if (is_far_enough && is_way_out(dodge, turned)) {
        dodge->turn_way = way;
        dodge->gap_way = 0;
        drive_on(dodge, way, twist);
    }
}

static void back_on(struct dodge *dodge, int32_t way, int32_t twist)
{
    if (way <= dodge->back_way || is_overdue(dodge)) {
        dodge->turn_side = lighter_side(dodge);
        begin_turn(dodge, twist, LONG_TWIST);
    }
}

static struct dodge_command command(const struct dodge *dodge)
{
    static const struct dodge_command fixed[DODGE_STATES] = {
        [DODGE_TURN_LEFT] = {-SPIN, SPIN},
        [DODGE_TURN_RIGHT] = {SPIN, -SPIN},
        [DODGE_BACK_OUT] = {-SLOW, -SLOW},
    };
    bool is_close = (dodge->seen & AHEAD) != 0; /* radius 0.36 m, else 0.89 m */
    int8_t inner = is_close ? 1 : 2;
    switch (dodge->state) {
    case DODGE_CRUISE:
        return dodge->seen ? (struct dodge_command){SLOW, SLOW} : (struct dodge_command){FAST, FAST};
    case DODGE_VEER_LEFT:
        return (struct dodge_command){inner, 3};
    case DODGE_VEER_RIGHT:
        return (struct dodge_command){3, inner};
    default:
        return fixed[dodge->state];
    }
}

static void note_gap(struct dodge *dodge, int32_t way)
{
    if (!is_shut(dodge)) {
        dodge->gap_way = 0;
    } else if (is_gap(dodge)) {
        dodge->gap_way += way - dodge->last_way;
    }
    dodge->last_way = way;
}

static void note_ground(struct dodge *dodge, int32_t way)
{
    if (dodge->state != DODGE_CRUISE) {
        dodge->straight_ticks = 0;
    } else if (dodge->straight_ticks <= STRAIGHT_TICKS) {
        dodge->straight_ticks++;
        dodge->ground_way = way;
    }
}

void dodge_start(struct dodge *dodge)
{
    /* No turn has been yet: the first one is free to choose its side. */
    *dodge = (struct dodge){.state = DODGE_CRUISE, .turn_side = +1, .turn_way = -SOON_WAY};
}

struct dodge_command dodge_tick(struct dodge *dodge, uint8_t sensors, int32_t left_steps, int32_t right_steps)
{
    int32_t way = left_steps + right_steps, twist = right_steps - left_steps;
    enum dodge_state before = dodge->state;
    update_seen(dodge, sensors);
    note_gap(dodge, way);
    switch (dodge->state) {
    case DODGE_TURN_LEFT:
    case DODGE_TURN_RIGHT:
        turn_on(dodge, way, twist);
        break;
    case DODGE_BACK_OUT:
        back_on(dodge, way, twist);
        break;
    default:
        drive_on(dodge, way, twist);
        break;
    }
    dodge->state_ticks = dodge->state == before ? dodge->state_ticks + 1 : 0;
    note_ground(dodge, way);
    return command(dodge);
}
