/* The decisions of robot_bench/firmware/dodge_fsm.c, which says what they are for, in another form: each side is a
 * record of its own, states stand in a table with what they do, and turns are chosen in one place. */
#include "dodge_fsm.h"

#include <stdbool.h>
#include <stddef.h>

enum { RELEASE = 25, SOON = 12, FUTILE = 3, LONG = 14, CIRCLE = 35, BOLD = 2, CONTRARY = 7, NARROW = 4 };
enum { BACK_LEAST = 6, BACK_MOST = 10, BACK_MARGIN = 4, OVERDUE = 1200, STRAIGHT = 60 };
enum { CREEPING = 1, SLOW, FAST };

/* What one side sees, the nearest to the front first. */
struct side {
    bool at_10, at_30, at_50, at_90;
};

struct view {
    struct side left, right;
};

const char *const dodge_state_names[DODGE_STATES] = {
    "CRUISE", "VEER_LEFT", "VEER_RIGHT", "TURN_LEFT", "TURN_RIGHT", "BACK_OUT",
};

static bool bit(uint8_t seen, unsigned number)
{
    return (seen >> number & 1u) != 0;
}

static struct view view_of(uint8_t seen)
{
    return (struct view){
        .left = {.at_10 = bit(seen, 3), .at_30 = bit(seen, 2), .at_50 = bit(seen, 1), .at_90 = bit(seen, 0)},
        .right = {.at_10 = bit(seen, 4), .at_30 = bit(seen, 5), .at_50 = bit(seen, 6), .at_90 = bit(seen, 7)},
    };
}

static bool blocks(struct view view)
{
    return view.left.at_10 || view.right.at_10;
}

static bool narrows(struct view view)
{
    return blocks(view) || view.left.at_30 || view.right.at_30;
}

static bool shuts(struct side side)
{
    return side.at_30 || side.at_50;
}

static bool is_passage(struct view view)
{
    return view.left.at_30 && view.right.at_30 && !blocks(view);
}

static bool is_between(struct view view)
{
    return shuts(view.left) && shuts(view.right);
}

static int danger(struct side side)
{
    if (side.at_10) {
        return 3;
    }
    if (side.at_30) {
        return 2;
    }
    return side.at_50;
}

static int weight(struct side side)
{
    return 4 * side.at_10 + 3 * side.at_30 + 2 * side.at_50 + side.at_90;
}

static void look(struct dodge *dodge, uint8_t sensors)
{
    for (unsigned number = 0; number < DODGE_SENSORS; number++) {
        uint8_t *unseen = &dodge->unseen_ticks[number];
        uint8_t mask = (uint8_t)(1u << number);
        if (bit(sensors, number)) {
            *unseen = 0;
            dodge->seen = (uint8_t)(dodge->seen | mask);
            continue;
        }
        if (!bit(dodge->seen, number)) {
            continue;
        }
        *unseen = (uint8_t)(*unseen + 1);
        if (*unseen >= RELEASE) {
            dodge->seen = (uint8_t)(dodge->seen ^ mask);
        }
    }
}

static int free_side(const struct dodge *dodge, struct view view)
{
    int difference = weight(view.right) - weight(view.left);
    if (difference == 0) {
        return dodge->turn_side;
    }
    return difference > 0 ? 1 : -1;
}

static void turn(struct dodge *dodge, int side, int32_t twist, int least)
{
    dodge->turn_side = side;
    dodge->turn_twist = twist;
    dodge->least_twist = least;
    dodge->state = side > 0 ? DODGE_TURN_LEFT : DODGE_TURN_RIGHT;
}

static void choose_turn(struct dodge *dodge, struct view view, int32_t way, int32_t twist, int least)
{
    bool is_new = way - dodge->turn_way >= SOON;
    int side = dodge->turn_side;
    dodge->turns += 1;
    if (is_new) {
        bool is_contrary = dodge->turns % CONTRARY == 0 && !is_between(view);
        side = free_side(dodge, view);
        side = is_contrary ? -side : side;
    }
    dodge->futile_turns = is_new ? 0 : dodge->futile_turns + 1;
    if (dodge->futile_turns >= FUTILE) {
        dodge->futile_turns = 0;
        least = LONG;
    }
    turn(dodge, side, twist, least);
}

static int32_t ground_behind(const struct dodge *dodge, int32_t way)
{
    if (dodge->straight_ticks <= STRAIGHT) {
        return 0;
    }
    int32_t ground = way - dodge->ground_way - BACK_MARGIN;
    return ground > BACK_MOST ? BACK_MOST : ground;
}

static void go_on(struct dodge *dodge, struct view view, int32_t way, int32_t twist)
{
    bool is_long_passage = dodge->gap_way >= NARROW;
    int32_t ground = ground_behind(dodge, way);
    if (blocks(view) || is_long_passage) {
        if (is_between(view) && ground >= BACK_LEAST) {
            dodge->state = DODGE_BACK_OUT;
            dodge->back_way = way - ground;
        } else {
            choose_turn(dodge, view, way, twist, is_long_passage ? LONG : 0);
        }
        return;
    }
    int difference = danger(view.left) - danger(view.right);
    dodge->state = difference > 0 ? DODGE_VEER_RIGHT : difference < 0 ? DODGE_VEER_LEFT : DODGE_CRUISE;
}

static void turn_further(struct dodge *dodge, struct view view, int32_t way, int32_t twist)
{
    int32_t turned = dodge->turn_side * (twist - dodge->turn_twist);
    bool is_late = dodge->state_ticks >= OVERDUE;
    if (turned < dodge->least_twist && !is_late) {
        return;
    }
    bool is_bold = is_late || turned >= CIRCLE || dodge->turns % BOLD == 0;
    bool is_free = is_bold ? !blocks(view) : !narrows(view);
    if (is_free || is_passage(view)) {
        dodge->gap_way = 0;
        dodge->turn_way = way;
        go_on(dodge, view, way, twist);
    }
}

static void back_further(struct dodge *dodge, struct view view, int32_t way, int32_t twist)
{
    if (dodge->state_ticks >= OVERDUE || way <= dodge->back_way) {
        turn(dodge, free_side(dodge, view), twist, LONG);
    }
}

static const struct {
    void (*decide)(struct dodge *dodge, struct view view, int32_t way, int32_t twist);
    /* Of the left and the right motor; an arc's inner wheel is slower where something is near. */
    struct dodge_command command;
} states[DODGE_STATES] = {
    [DODGE_CRUISE] = {go_on, {FAST, FAST}},
    [DODGE_VEER_LEFT] = {go_on, {SLOW, FAST}},
    [DODGE_VEER_RIGHT] = {go_on, {FAST, SLOW}},
    [DODGE_TURN_LEFT] = {turn_further, {-SLOW, SLOW}},
    [DODGE_TURN_RIGHT] = {turn_further, {SLOW, -SLOW}},
    [DODGE_BACK_OUT] = {back_further, {-SLOW, -SLOW}},
};

static struct dodge_command commanded(enum dodge_state state, uint8_t seen)
{
    struct dodge_command found = states[state].command;
    switch (state) {
    case DODGE_CRUISE:
        if (seen != 0) {
            found = (struct dodge_command){SLOW, SLOW};
        }
        break;
    case DODGE_VEER_LEFT:
        found.left = narrows(view_of(seen)) ? CREEPING : SLOW;
        break;
    case DODGE_VEER_RIGHT:
        found.right = narrows(view_of(seen)) ? CREEPING : SLOW;
        break;
    default:
        break;
    }
    return found;
}

void dodge_start(struct dodge *dodge)
{
    *dodge = (struct dodge){.turn_side = 1, .turn_way = -SOON};
}

struct dodge_command dodge_tick(struct dodge *dodge, uint8_t sensors, int32_t left_steps, int32_t right_steps)
{
    const enum dodge_state before = dodge->state;
    const int32_t way = right_steps + left_steps;
    look(dodge, sensors);
    const struct view view = view_of(dodge->seen);
    dodge->gap_way = !is_between(view) ? 0 : is_passage(view) ? dodge->gap_way + way - dodge->last_way : dodge->gap_way;
    dodge->last_way = way;
    states[before].decide(dodge, view, way, right_steps - left_steps);
    dodge->state_ticks = before == dodge->state ? dodge->state_ticks + 1 : 0;
    if (dodge->state != DODGE_CRUISE) {
        dodge->straight_ticks = 0;
    } else if (dodge->straight_ticks <= STRAIGHT) {
        dodge->ground_way = way;
        dodge->straight_ticks += 1;
    }
    return commanded(dodge->state, dodge->seen);
}
