"""Monitors in C with a defect of the sums beside the slow-fault tests, or of these tests."""

from __future__ import annotations

from unit_defects import Defect

SUMS = [
    Defect("sums with the biases that are learned", "(f->x[c] - s->slow_tests.bias[c]) - m;", "f->x[c] - m;"),
    Defect(
        "sums about the middle of the samples beside the tests",
        "if (tests_run(&s->slow_tests)) {",
        "if (tests_run(&s->slow_tests) && (f->n < 0)) {",
    ),
    Defect("a test told as the sums", "f->slow_by = s->slow_tests.by;", "f->slow_by = RIG_DECIDED_BY_SLOW;"),
]
OF_MEANS = [
    Defect("limits of five standard deviations", "#define SIGMAS 6.0 ", "#define SIGMAS 5.0 "),
    Defect(
        "a burst counts in the noise in full",
        "gain * (smaller(residual * residual, most_whole) - t->whole[c])",
        "gain * (larger(residual * residual, 0.0 * most_whole) - t->whole[c])",
    ),
    Defect("the noise is cut where squares are", "#define WHOLE 2.0 ", "#define WHOLE 1.0 "),
    Defect("long means need 14 frames for a limit", "#define REMEMBERED 20.0 ", "#define REMEMBERED 14.0 "),
    Defect(
        "a burst counts in the mean of squares in full",
        "gain * (smaller(r * r, most) - t->square[c])",
        "gain * (larger(r * r, 0.0 * most) - t->square[c])",
    ),
    Defect(
        "the bound of a bias without the error of scale",
        "((1.6 * t->set->slow_scale) * fabs(t->usual_middle))",
        "((0.0 * t->set->slow_scale) * fabs(t->usual_middle))",
    ),
    Defect(
        "no allowance for motion",
        "const double r = copysign(larger(fabs(residual) - allowed, 0.0), residual);",
        "const double r = residual - (0.0 * allowed);",
    ),
]
OF_HALVES = [
    Defect(
        "the reference's bias is known as well after a change of level",
        "(t->set->slow_reference_frames * motion)) + moved",
        "(t->set->slow_reference_frames * motion)) + (0.0 * moved)",
    ),
    Defect(
        "a burst counts in the mean square of halves in full",
        "(smaller(d * d, steps.square) - h->energy[w]) * gain",
        "((d * d) - h->energy[w]) * gain",
    ),
    Defect("halves decide by their mean alone", "(h->energy[way] - healthy) / (healthy * h->square_limit)", "0.0"),
    Defect(
        "of the last two the lower sample is the first half",
        "(t->order[0] < t->order[1]) ? t->order[0] : t->order[1]",
        "t->order[0]",
    ),
    Defect("halves of four in one way alone", "return 1U | (2U << way);", "return 1U | ((way < 0) ? 0U : 2U);"),
]
OF_NOISE = [
    Defect("of two the quiet one is isolated", "((a < b) == (s->rougher > 0.0))", "((a < b) == (s->rougher < 0.0))"),
    Defect("the noise of two is told by no second difference", "= moved - s->last_moved;", "= moved;"),
    Defect("a burst counts in the noise of two in full", "clamp(apart * turn, -step, step)", "(apart * turn)"),
]
OF_MOTION = [
    Defect(
        "the middle of a split moves as the aircraft",
        "(split || off_majority(f))",
        "off_majority(f)",
    ),
    Defect(
        "a middle off the majority moves as the aircraft",
        "(split || off_majority(f))",
        "(split || (off_majority(f) && (f->n < 0)))",
    ),
    Defect("the way out of a split is a second difference", "if (s->turns <= 3) {", "if (s->turns <= 2) {"),
    Defect("tests where a channel is missing", "(f->n < 2) || !s->split.whole;", "(f->n < 2);"),
    Defect("the change over a gap moves as that of a frame", "/ ((double)t->away + 1.0);", "/ 1.0;"),
    Defect("the motion in which a bias was learned", "fabs(t->rate - t->usual_rate)", "fabs(t->rate)"),
    Defect("noise within the data sheet", "(sheet * sheet) - (FOLLOWS * variance)", "0.0 * (sheet * FOLLOWS)"),
    Defect(
        "half of the noise where four were never in use",
        "slow_noise * TESTS_LEAST;\n        return",
        "slow_noise;\n        return",
    ),
    Defect("the age of the noise after a stop", "    s->turned++;\n", "    s->turned = s->turns;\n"),
    Defect(
        "tests at the end of the range", "|| tests_is_cut(m, p, t)) {", "|| (tests_is_cut(m, p, t) && (f->n < 0))) {"
    ),
    Defect(
        "sums at the end of the range",
        "if (tests_is_cut(m, p, &s->slow_tests)) {",
        "if (tests_is_cut(m, p, &s->slow_tests) && (f->n < 0)) {",
    ),
]
SLOW_DEFECTS = [*SUMS, *OF_MEANS, *OF_HALVES, *OF_NOISE, *OF_MOTION]
