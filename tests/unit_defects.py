"""Defects of the monitor in C, each a replacement in the text of docs/examples/unit: the vectors find them all."""

from __future__ import annotations

from typing import NamedTuple


class Defect(NamedTuple):
    """``old`` stands once in all files of the monitor."""

    name: str
    old: str
    new: str


IN_RANGE = "(p->low <= f->samples[c]) && (f->samples[c] <= p->high)"
SAMPLES = [
    Defect("the flag of an invalid sample ignored", "return (f->valid[c] != 0) && (p->low", "return (p->low"),
    Defect("a sample out of range compared", IN_RANGE, "isfinite(f->samples[c]) && (p->low <= p->high)"),
    Defect("an infinite sample compared", IN_RANGE, f"(isinf(f->samples[c]) || ({IN_RANGE}))"),
    Defect("a sample that is no number compared", IN_RANGE, f"(isnan(f->samples[c]) || ({IN_RANGE}))"),
    Defect(
        "two samples a threshold apart disagree",
        "!((f->y[f->by[i]] - f->y[f->by[i - 1]]) <= f->threshold)",
        "!((f->y[f->by[i]] - f->y[f->by[i - 1]]) < f->threshold)",
    ),
    Defect(
        "an angle compared as a plain number",
        "return (p->wraps != 0) ? (modulo_turn((a",
        "return (p->wraps > 1) ? (modulo_turn((a",
    ),
    Defect(
        "the vote of an angle out of its range",
        "(p->wraps != 0) ? (modulo_turn(x - p->low)",
        "(p->wraps > 1) ? (modulo_turn(x - p->low)",
    ),
]
VOTES = [
    Defect("the median of an even number is the lower one", "s->rise_vote) : 0.5", "s->rise_vote) : 0.0"),
    Defect(
        "the median of three is the smallest",
        "if ((f->n % 2) == 1) {\n        return f->high;",
        "if ((f->n % 2) == 1) {\n        return f->x[f->order[0]];",
    ),
    Defect("a suspect in the mean", "if (f->alone[f->order[f->n / 2]]) {", "if (f->n < 0) {"),
    Defect(
        "a lost signal votes zero",
        "if (f->n == 0) {\n        f->vote = s->vote;",
        "if (f->n == 0) {\n        f->vote = 0.0;",
    ),
    Defect(
        "the newest trend bit at the wrong end",
        "t->high = ((t->high << 1) | ((f->rise_high > 0.0) ? 1U : 0U)) & mask;",
        "t->high = (t->high >> 1) | ((f->rise_high > 0.0) ? ((mask + 1U) / 2U) : 0U);",
    ),
    Defect("a trend at rest counts as rising", "(f->rise_low > 0.0)", "(f->rise_low >= 0.0)"),
    Defect("the trend of another number of samples kept", "(f->n == s->last_n) && (f->n > 0)", "(f->n > 0)"),
]
TIE_BREAKS = [
    Defect(
        "an absent monitor read as bad",
        "count += (f->ilm[f->by[i]] == flag) ? 1 : 0;",
        "count += ((f->ilm[f->by[i]] == flag) || (f->ilm[f->by[i]] > flag + 1)) ? 1 : 0;",
    ),
    Defect(
        "an absent monitor disputes the last channel",
        "bad = f->ilm[c] == RIG_ILM_BAD;",
        "bad = f->ilm[c] != RIG_ILM_GOOD;",
    ),
    Defect(
        "the extremes kept, the others failed",
        "blame_all_but(low, high, f);",
        "blame_all_but(f->by[0], f->by[f->n - 1], f);",
    ),
    Defect(
        "the middle and what is beside it kept", "blame_all_but(low, high, f);", "blame_all_but(f->by[1], f->by[2], f);"
    ),
    Defect(
        "extremes and middle without being configured",
        "if (p->tie_break[place] == rule) {",
        "if (p->tie_break[place] >= 0) {",
    ),
    Defect(
        "neither rank rising blames the smaller half",
        "(says == TREND_SMALLER_TRUE) ? HIGH_SIDE",
        "(says == TREND_SMALLER_TRUE) ? LOW_SIDE",
    ),
    Defect(
        "the reference blames the half that it is near to",
        "if (reference >= above) {\n        return LOW_SIDE;",
        "if (reference >= above) {\n        return HIGH_SIDE;",
    ),
    Defect(
        "the last channel within one reference threshold",
        "(apart > (REFERENCE_MARGIN * f->reference_threshold))",
        "(apart > f->reference_threshold)",
    ),
    Defect(
        "a reference never trusted again",
        "s->reference_usable = agrees;",
        "s->reference_usable = agrees && s->reference_usable;",
    ),
    Defect(
        "a common mode reported a frame late",
        "s->common_run >= p->common_persistence",
        "s->common_run > p->common_persistence",
    ),
    Defect(
        "the second reference ignored",
        "f.second = seen(input->second_reference[signal], &f, p);",
        "f.second = f.reference;",
    ),
    Defect(
        "a common mode of references that are apart",
        "(apart <= (f->reference_threshold + p->second_threshold))",
        "(apart >= 0.0)",
    ),
    Defect(
        "a common mode within one reference threshold", "margin = REFERENCE_MARGIN * threshold;", "margin = threshold;"
    ),
    Defect(
        "a common mode that is to be reported fails the signal",
        "if (s->common_mode && (p->common_fails != 0)) {",
        "if (s->common_mode) {",
    ),
]
STARTS = [
    Defect("a frame without a sample begins the vote", "s->started = s->started || (f->n > 0);", "s->started = true;"),
]
LATCHES = [
    Defect(
        "failed a frame late",
        "(s->latches.count[c] >= (double)p->persistence)",
        "(s->latches.count[c] > (double)p->persistence)",
    ),
    Defect(
        "a pattern settled a frame late",
        "s->pattern_frames >= p->split_persistence",
        "s->pattern_frames > p->split_persistence",
    ),
    Defect(
        "an agreeing frame does not end the count",
        ": counted_down(count[c], &s->rules);",
        ": (count[c] + (0.0 * counted_down(count[c], &s->rules)));",
    ),
    Defect(
        "counts go on in a split",
        "s->split_run++;\n        return true;",
        "s->split_run++;\n        return false;",
    ),
    Defect(
        "counts go on after a split",
        "s->freeze = (wait > s->freeze) ? wait : s->freeze;",
        "s->freeze = 0 * wait;",
    ),
    Defect("an earlier wait forgotten", "s->freeze = (wait > s->freeze) ? wait : s->freeze;", "s->freeze = wait;"),
    Defect("the count of a last channel stands still", "return f->n != 1;", "return f->n >= 0;"),
    Defect(
        "the counts of missing samples stand still",
        "s->latches.failed[c] || (ranked && still)",
        "s->latches.failed[c] || still",
    ),
    Defect(
        "a failed channel comes back by itself",
        "s->latches.agreed[c] = agrees ? (s->latches.agreed[c] + 1) : 0;",
        "s->latches.failed[c] = s->latches.failed[c] && !agrees;",
    ),
    Defect(
        "readmission without agreement",
        "wanted && latches->failed[c] && (latches->agreed[c] >= readmit_frames)",
        "wanted && latches->failed[c] && (readmit_frames > 0)",
    ),
    Defect(
        "readmission a frame early",
        "(latches->agreed[c] >= readmit_frames)",
        "(latches->agreed[c] + 1 >= readmit_frames)",
    ),
    Defect(
        "a break does not end the wait for a reset",
        "agrees ? (s->latches.agreed[c] + 1) : 0",
        "agrees ? (s->latches.agreed[c] + 1) : s->latches.agreed[c]",
    ),
    Defect("the reset of one channel resets all", "wanted = has(commanded, c);", "wanted = commanded != 0U;"),
    Defect(
        "a channel that is counted is not suspect", "|| (s->latches.count[c] > 0.0)", "|| (s->latches.count[c] < 0.0)"
    ),
    Defect(
        "a channel that is not fitted is ok",
        "if (c >= p->fitted) {\n        return RIG_STATE_ABSENT;",
        "if (c >= p->fitted) {\n        return RIG_STATE_OK;",
    ),
    Defect("the last session remembered", "memset(signals, 0, sizeof signals);", "memset(signals, 0, 1);"),
]
BOXES = [
    Defect("a box for two signals fewer", "(against >= needed[b]) ?", "(against >= needed[b] - 2) ?"),
    Defect(
        "a box failed a frame late", "count[b][c] >= config->box_persistence", "count[b][c] > config->box_persistence"
    ),
    Defect("half of the boxes not failed", "(2 * candidates) <= units", "(2 * candidates) < units"),
    Defect("a majority of boxes failed", "(2 * candidates) <= units", "candidates <= units"),
    Defect(
        "the trend accuses a box",
        "(f->decided_by == RIG_DECIDED_BY_ILM) || (f",
        "(f->decided_by == RIG_DECIDED_BY_TREND) || (f",
    ),
]
DISCRETES = [
    Defect("a tie of a discrete is one", "return (uint8_t)config[d].fail_safe;", "return 1;"),
    Defect(
        "the level of a discrete counts failed channels",
        "output->discrete_level[d] = level;",
        "output->discrete_level[d] = (uint8_t)(level + 0 * d + 1);",
    ),
    Defect(
        "a discrete channel failed a frame late",
        "l->count[c] >= (double)config[d].persistence",
        "l->count[c] > (double)config[d].persistence",
    ),
    Defect(
        "an agreeing frame of a discrete does not end the count",
        "agrees ? 0.0 : (l->count[c] + 1.0)",
        "agrees ? l->count[c] : (l->count[c] + 1.0)",
    ),
    Defect(
        "an absent monitor of a discrete read as bad",
        "input->discrete_ilm[d][c] != RIG_ILM_BAD",
        "input->discrete_ilm[d][c] == RIG_ILM_GOOD",
    ),
    Defect(
        "a bad monitor of a discrete ignored",
        "(input->discrete_valid[d][c] != 0) && (input->discrete_ilm[d][c] != RIG_ILM_BAD)",
        "input->discrete_valid[d][c] != 0",
    ),
    Defect("the flag of a discrete ignored", "(input->discrete_valid[d][c] != 0) && (input", "(input"),
    Defect("a failed discrete channel votes", "!latches[d].failed[c] && comparable", "comparable"),
]
LEVELS_AND_FILTER = [
    Defect("three samples with the threshold of four", "(n == 3) ? p->threshold_triplex", "(n == 3) ? p->threshold"),
    Defect("two samples with the threshold of four", ": p->threshold_duplex;", ": p->threshold;"),
    Defect("no filter", "if (p->filter_gain > 0.0) {", "if (p->filter_gain > 1.0) {"),
    Defect("a step of the filter not limited", "fabs(step) > limit", "fabs(step) > (1e9 * limit)"),
    Defect(
        "the filter goes on over a gap",
        "s->smooth[c] = there ? compare_follow(last, near_base(f->samples[c], f, p), f, p) : (double)NAN;",
        "s->smooth[c] = there ? compare_follow(last, near_base(f->samples[c], f, p), f, p) : s->smooth[c];",
    ),
    Defect(
        "the filter begins with zero",
        "    if (isnan(last)) {\n        return x;",
        "    if (isnan(last)) {\n        return 0.0 * x;",
    ),
    Defect(
        "compared in the order of the samples",
        "        sort_again(f->y, f->by, f->n);\n",
        "        (void)sort_again;\n",
    ),
    Defect(
        "the filtered value voted by the reference",
        "const double high = f->x[f->by[f->n / 2]];",
        "const double high = f->y[f->by[f->n / 2]];",
    ),
    Defect("the filtered value voted", "f->vote = f->x[good];", "f->vote = f->y[good];"),
    Defect("readmission by the sample itself", "samples = filtered ? s->smooth : f->samples", "samples = f->samples"),
    Defect("readmission to the unfiltered vote", "vote = s->smooth_vote;", "vote = f->vote;"),
]
SLOW_TESTS = [
    Defect(
        "a limit that leaves out what the bias may be off by",
        "sqrt((0.5 / TESTS_SLOW) + (1.0 / known))",
        "sqrt((0.5 / TESTS_SLOW) + (0.0 / known))",
    ),
    Defect(
        "the limit of squares with the bias of a mean",
        "sqrt((1.0 / SQUARE) + (2.0 / known))",
        "sqrt((1.0 / SQUARE) + (1.0 / known))",
    ),
    Defect("limits that are computed once", "? (1.1 * known) : (double)INFINITY", "? (1e9 * known) : (double)INFINITY"),
    Defect("the slow mean kept at another level", "        t->slow[c] = 0.0;\n", ""),
    Defect("a burst counts in the fast mean in full", "clamp(z, -t->fast_step, t->fast_step)", "z"),
    Defect("a bias of any size", "-furthest, furthest)", "-(1e9 * furthest), 1e9 * furthest)"),
    Defect("a burst is learned in full", "clamp(t->value[c] - m, -most, most)", "(t->value[c] - (m + (0.0 / most)))"),
    Defect(
        "frames in motion weigh as much as others",
        "weight = noise / (noise + (skewed * skewed));",
        "weight = noise / (noise + (0.0 * skewed));",
    ),
    Defect("what is known counted in frames", "t->known += weight;", "t->known += 1.0;"),
    Defect("what is known kept after a reset", "    t->known = 0.0;\n", ""),
    Defect("learned while a test suspects", "t->halves.share) < CALM)", "t->halves.share) < 1e9)"),
    Defect(
        "the noise is that of the quietest channel", "t->shaken = (n > 2) ? second : lowest;", "t->shaken = lowest;"
    ),
    Defect("one channel isolated beside a second", "< (CALM * t->share[worst])", "<= t->share[worst]"),
    Defect("squares told as means", "(larger(fast, slow) >= t->share[worst]) ?", "(larger(fast, slow) >= 0.0) ?"),
    Defect("halves told as means", "t->by = RIG_DECIDED_BY_SLOW_HALVES;", "t->by = RIG_DECIDED_BY_SLOW_MEANS;"),
    Defect("the wrong half", "return (slope > 0.0) ? 1 : -1;", "return (slope > 0.0) ? -1 : 1;"),
    Defect("a half isolated in the ninth frame", "#define DECIDING 10 ", "#define DECIDING 9 "),
    Defect("a half decided by any slope", "!(((steep - 0.5) * size) <= near)", "!(size >= 0.0)"),
    Defect("a reference too good to decide is asked", "!((size * (steep + 0.5)) >= near)", "!(size >= 0.0)"),
    Defect(
        "the reference's bias not learned",
        "const double bias = t->reference_bias + (share * clamp(t->reference_off, -most, most));",
        "const double bias = 0.0 * share;",
    ),
    Defect(
        "an unusable reference is learned",
        "if (usable) {\n        halves_learn",
        "if (usable || true) {\n        halves_learn",
    ),
    Defect(
        "a reference far off is learned at once",
        "(share * clamp(t->reference_off, -most, most))",
        "(share * t->reference_off)",
    ),
    Defect("a reference asked before it is known", "#define REFERENCE_FROM 300 ", "#define REFERENCE_FROM 100 "),
]
DEFECTS = [*SLOW_TESTS, *LEVELS_AND_FILTER, *SAMPLES, *VOTES, *TIE_BREAKS, *STARTS, *LATCHES, *BOXES, *DISCRETES]
