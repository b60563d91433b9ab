"""Monitors in C with an older rule, or one misread, of those that version 3 of the records came with."""

from __future__ import annotations

from unit_defects import Defect

REFERENCES = [
    Defect(
        "a reference compared with the vote",
        "agrees = off_ranks(f, p) <= f->reference_threshold;",
        "agrees = fabs(difference(f->vote, f->reference, p)) <= f->reference_threshold;",
    ),
    Defect(
        "a reference compared with the upper rank",
        "return (off_low < off_high) ? off_low : off_high;",
        "return off_high + (0.0 * off_low);",
    ),
    Defect(
        "a reference judged by a suspected pair",
        "|| s->after_extremes || s->slow_faults.standing)",
        "|| s->slow_faults.standing)",
    ),
    Defect("a suspected pair never cut", "if (!s->after_extremes) {", "if (s->level >= 0) {"),
    Defect(
        "a suspected pair cut a frame late",
        "if (s->cut_frames >= p->persistence) {",
        "if (s->cut_frames > p->persistence) {",
    ),
    Defect(
        "any pair suspected",
        "settled && (f->decided_by == RIG_DECIDED_BY_EXTREMES) && (s->level == 2)",
        "settled && (s->level == 2)",
    ),
    Defect(
        "a reference beyond the range",
        "near_base(reference, f, p) : clamp(reference, p->low, p->high);",
        "near_base(reference, f, p) : reference;",
    ),
    Defect("no disputes", "s->in_dispute && (s->common_run == 0)", "s->in_dispute && (s->common_run < 0)"),
    Defect("a dispute ends a run", "s->in_dispute && (s->common_run == 0)", "s->in_dispute"),
    Defect("a first reference disputes nothing", "if (!s->reference_usable || (s->second", "if ((s->second"),
    Defect(
        "a second reference disputes nothing",
        "(s->second_run >= config->signal[i].persistence)",
        "(s->second_run >= (1000 * config->signal[i].persistence))",
    ),
    Defect(
        "a second reference disputes at once",
        "(s->second_run >= config->signal[i].persistence)",
        "((1000 * s->second_run) >= config->signal[i].persistence)",
    ),
    Defect(
        "every dispute is everybody's",
        "(in_dispute & signals[i].rules.sources) != 0",
        "(in_dispute != 0) && (signals[i].rules.sources != 0)",
    ),
]
SPLITS = [
    Defect(
        "settled by any answer",
        "&& stands;",
        ";",
    ),
    Defect(
        "settled by an answer of the whole time",
        "= (2 * split->stood) >= p",
        "= split->stood >= p",
    ),
    Defect("an answer is its rule alone", "&& (blames == split->blames) &&", "&&"),
    Defect("an answer is whom it blames alone", "same = (f->decided_by == split->rule) && (blames", "same = (blames"),
    Defect("never given up", "(most <= 0) || (s->split", "(most >= 0) || (s->split"),
    Defect("given up a frame late", "(s->split.unresolved < most)", "(s->split.unresolved <= most)"),
    Defect(
        "given up by the frames of one pattern",
        "        split->unresolved++;",
        "        split->unresolved = ((s->pattern_frames > 1) ? split->unresolved : 0) + 1;",
    ),
    Defect(
        "the vote moves with the ranks",
        "return between(f->x[split->held_low], f->x[split->held_high], split->held_share);",
        "return (s->pattern_frames == 1) ? s->vote : (s->vote + (0.5 * (f->rise_high + f->rise_low)));",
    ),
    Defect(
        "the shares found in every frame",
        "if ((split->held_of != f->ranked) || (fabs",
        "if ((split->held_of != 0U) || (split->held_of != f->ranked) || (fabs",
    ),
    Defect(
        "the shares of a split before",
        "split->held_of = majority ? 0U : split->held_of;",
        "",
    ),
]
TRENDS = [
    Defect("a frozen side falls", "|| ((t->still_high >= frames) != (t->still_low >= frames))", ""),
    Defect(
        "two frozen sides have no trend",
        "((t->still_high >= frames) != (t->still_low >= frames))",
        "((t->still_high >= frames) || (t->still_low >= frames))",
    ),
    Defect("small changes as any others", "one ? 1 : p->trend_frames", "one ? p->trend_frames : p->trend_frames"),
    Defect(
        "one small change is enough",
        "(fabs(f->rise_high) <= small) && (fabs(f->rise_low) <= small)",
        "(fabs(f->rise_high) <= small) || (fabs(f->rise_low) <= small)",
    ),
    Defect(
        "windows that slide",
        "r->trend_tumbles = told->trend_tumbles != 0;",
        "r->trend_tumbles = told->trend_tumbles > 1;",
    ),
    Defect(
        "the verdict of a window that is not whole",
        "    if (s->rules.trend_tumbles) {",
        "    if (s->rules.trend_tumbles && (s->trend.seen < 0)) {",
    ),
    Defect("the trend always asked", "(told->referred == 0) ||", "(told->referred <= 1) ||"),
    Defect("the trend never asked beside a reference", "|| (told->trend_beside_reference != 0)", ""),
    Defect("never both sides wrong", "s->after_extremes ? (LOW_SIDE + HIGH_SIDE) : NO_ANSWER", "NO_ANSWER"),
    Defect("a good pair not weighted", "(p->weighted != 0) && (half == 2)", "(p->weighted > 1) && (half == 2)"),
    Defect(
        "a good pair weighted the other way",
        "trend_weight(rise_b, rise_a, s->rise_vote)",
        "trend_weight(rise_a, rise_b, s->rise_vote)",
    ),
    Defect(
        "two samples not weighted",
        "(p->weighted != 0) && trend && (f->n == 2)",
        "(p->weighted > 1) && trend && (f->n == 2)",
    ),
]
REPEATS = [
    Defect("a stale sample compared", "&& !slow_is_stale(c, &s->slow_faults) && compare", "&& compare"),
    Defect(
        "repeats of all at rest",
        "((2 * m->moving) >= others)",
        "((2 * m->moving) >= 0)",
    ),
    Defect(
        "repeats of sensors at their stop",
        "*ends = !told && (p->wraps == 0)",
        "*ends = !told && (c < 0) && (p->wraps == 0)",
    ),
    Defect(
        "a gap ends a count",
        "        if (compare_is_comparable(f, c, p)) {\n            bool ends",
        "        l->last_sample[c] = compare_is_comparable(f, c, p) ? l->last_sample[c] : (double)NAN;\n"
        "        if (compare_is_comparable(f, c, p)) {\n            bool ends",
    ),
    Defect(
        "nothing moves beside the only channel",
        "(others == 0) ? m->reference",
        "(others == 0) ? false",
    ),
    Defect(
        "an agreeing frame ends a count",
        "((r->count_down > 0.0) && (left > 0.0)) ? left : 0.0",
        "((r->count_down < 0.0) && (left > 0.0)) ? left : 0.0",
    ),
    Defect(
        "an agreeing frame takes one off a count",
        "left = count - r->count_down;",
        "left = count - ((r->count_down > 0.0) ? 1.0 : 0.0);",
    ),
]
BOXES = [
    Defect("all signals in one box", "r->box = told->box;", "r->box = 1;"),
    Defect("half of a box is enough", "return (size / 2) + 1;", "return size / 2;"),
    Defect("a small box never dies", "return (asked < size) ? asked : size;", "return asked;"),
    Defect("a box of one signal dies", "if (size < 2) {", "if (size < 1) {"),
    Defect(
        "a majority of the channels anywhere",
        "        if (signals[i].rules.box == b) {\n            against",
        "        in_use = in_use || ((c < config->signal[i].fitted) && !signals[i].latches.failed[c]);\n"
        "        if (signals[i].rules.box == b) {\n            against",
    ),
    Defect("a box that is accused now and then", "? (count[b][c] + 1) : 0;", "? (count[b][c] + 1) : count[b][c];"),
    Defect(
        "a box fails those beside it",
        "            if (signals[i].rules.box == b) {\n                fail_all",
        "            if (signals[i].rules.box >= 0) {\n                fail_all",
    ),
]
FILTER = [
    Defect(
        "a miscompare behind a filter counts always",
        "(f->alone[c] && is_off(c, f, p))",
        "(f->alone[c] && (is_off(c, f, p) || (f->n > 0)))",
    ),
    Defect(
        "the rest of a burst takes the count to zero",
        "f->alone[c] ? larger(0.0, count[c] - 1.0) :",
        "f->alone[c] ? 0.0 :",
    ),
    Defect("the rest of a burst leaves the count", "larger(0.0, count[c] - 1.0)", "count[c]"),
    Defect(
        "the filter's value off the vote",
        "off = difference(f->x[c], f->vote, p);",
        "off = difference(f->y[c], f->vote, p);",
    ),
    Defect("a split that has closed goes on", "} else if (!f->together) {", "} else if (f->n >= 0) {"),
    Defect(
        "a split that has closed settles",
        "    if (f->together) {\n        return false;",
        "    if (f->together && (f->n < 0)) {\n        return false;",
    ),
    Defect(
        "a split of three never closes",
        "(below <= f->threshold) || (above <= f->threshold)",
        "(below < 0.0) || (above < 0.0)",
    ),
    Defect(
        "a filter that goes on over stale samples",
        "compare_is_comparable(f, c, p) && !slow_is_stale(c, &s->slow_faults);\n            const double last",
        "compare_is_comparable(f, c, p);\n            const double last",
    ),
    Defect("a common mode of a pair that was cut", " || s->latches.failed[f->order[0]]", ""),
    Defect("the suspicion of a pair after a readmission", "    references_readmit(before.failed, s);\n", ""),
    Defect(
        "agreement of a channel out of range",
        "there = compare_is_comparable(f, c, p) && !slow_is_stale(c, &s->slow_faults) && !has",
        "there = (f->valid[c] != 0) && !slow_is_stale(c, &s->slow_faults) && !has",
    ),
    Defect("agreement of a channel that the frame has failed", " && !has(f->ranked, c);", ";"),
]
GAPS = [
    Defect(
        "a held channel that jumps",
        "(fabs(gap - split->held_gap) > f->threshold)",
        "(fabs(gap - split->held_gap) < 0.0)",
    ),
    Defect(
        "a reference judged by channels that stand still",
        "|| s->after_extremes || s->slow_faults.standing)",
        "|| s->after_extremes)",
    ),
    Defect(
        "a filter that begins with its sample",
        "isnan(s->smooth[c]) ? start : s->smooth[c]",
        "s->smooth[c]",
    ),
    Defect(
        "a young answer ends the wait",
        "stands ? 0 : split->unresolved",
        "0",
    ),
    Defect(
        "a gap ends the wait",
        "split->whole ? 0 : split->unresolved",
        "0",
    ),
    Defect(
        "repeats that the reference tells",
        "told || (!*ends && most)",
        "!*ends && most",
    ),
]
OLD_RULES = [
    *GAPS,
    *FILTER,
    *REFERENCES,
    *SPLITS,
    *TRENDS,
    *REPEATS,
    *BOXES,
]
