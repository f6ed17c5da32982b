#include "judge/verdict.h"

#include <math.h>

/* So much better agreement of form decides for a hand or pose, whatever the distances say, where
 * there is evidence for it, and this part of what shapes usually have: of a pose more. */
static const double clearly = 0.3, decisive = 0.5, decisive_pose = 0.75;
/* What has to speak for a hand where its mirror image leaves the particles in their places. */
static const double told_in_place = 1.0;
/* What speaks for a pose against the orientation that all others share, from where it is believed.
 */
static const double against_others = 2.0;

/* (J6), fitted by benchmarks/trust/fit; beyond `most_evidence` either way there is no more to tell,
 * nor below `least_pose` anything, unless it speaks against. */
static const double at_nothing = 3.52, by_evidence = -0.28, by_agreement = -4.61;
static const double most_against = 1.0, most_evidence = 2.0, most_agreement = 2.5, least_pose = 0.5;
static const double least_probability = 0.04;

#define ASPECT_NAME(name, text) text,
static const char *const aspect_name[] = { APSM_ASPECT_LIST(ASPECT_NAME) };
#define DOUBT_TEXT(name, aspect, text) text,
static const char *const doubt_text[] = { APSM_DOUBT_LIST(DOUBT_TEXT) };
#define DOUBT_ASPECT(name, aspect, text) aspect,
static const apsm_aspect doubt_aspect[] = { APSM_DOUBT_LIST(DOUBT_ASPECT) };

const char *apsm_aspect_name(apsm_aspect aspect)
{
    return (unsigned)aspect < APSM_ASPECT_COUNT ? aspect_name[aspect] : "unknown";
}

const char *apsm_doubt_text(apsm_doubt doubt)
{
    return (unsigned)doubt < APSM_DOUBT_COUNT ? doubt_text[doubt] : "unknown";
}

apsm_aspect apsm_doubt_aspect(apsm_doubt doubt)
{
    return doubt_aspect[doubt];
}

apsm_verdict_options apsm_verdict_defaults(void)
{
    return (apsm_verdict_options){ .slip = 2.25,
                                   .slip_size = 0.03,
                                   .clear_slip = 3.5,
                                   .clear_size = 0.01,
                                   .reach_excess = 4.5,
                                   .reach_size = 0.35,
                                   .farthest = 1.4,
                                   .off = 2.25,
                                   .off_excess = 5.0,
                                   .size = 1.4,
                                   .size_excess = 6.0,
                                   .part = 2.25,
                                   .part_excess = 4.0,
                                   .part_size = 0.2,
                                   .large_excess = 2.5,
                                   .large_size = 0.4,
                                   .against = 0.2,
                                   .told = 0.3 };
}

static bool is_unlike(const apsm_departure *part, const apsm_verdict_options *o)
{
    const bool large = part->size > o->large_size;
    return part->times > o->part && part->size > o->part_size &&
           part->excess > (large ? o->large_excess : o->part_excess);
}

const apsm_departure *apsm_verdict_part(const apsm_findings *f, const apsm_verdict_options *o)
{
    const apsm_departure *part = f->part;
    for (size_t k = 1; k < APSM_DEPART_LOOKS; k++) {
        const bool unlike = is_unlike(&f->part[k], o), before = is_unlike(part, o);
        if (unlike != before ? unlike : f->part[k].times > part->times) part = &f->part[k];
    }
    return part;
}

static bool has_slipped(const apsm_findings *f, const apsm_verdict_options *o)
{
    return (f->slip > o->slip && f->slip_size > o->slip_size) ||
           (f->slip > o->clear_slip && f->slip_size > o->clear_size);
}

/* What does not belong slips, and has no pose, as well: that is not told then. */
unsigned apsm_verdict_doubts(const apsm_findings *f, const apsm_verdict_options *o)
{
    unsigned doubts = 0;
    if (f->off > o->off && f->off_excess > o->off_excess) doubts |= 1u << APSM_DOUBT_FORM;
    if (fabs(log(f->size)) > log(o->size) && fabs(f->size_excess) > o->size_excess)
        doubts |= 1u << APSM_DOUBT_SIZE;
    if (doubts) return doubts;
    doubts |= (unsigned)(f->turn[0].evidence < -o->against) << APSM_DOUBT_TURNED;
    doubts |= (unsigned)(f->turn[1].evidence < -o->against) << APSM_DOUBT_MIRRORED;
    if (!doubts && is_unlike(apsm_verdict_part(f, o), o)) doubts |= 1u << APSM_DOUBT_PART;
    if (has_slipped(f, o)) doubts |= 1u << APSM_DOUBT_SLIP;
    if ((f->reach_excess > o->reach_excess && f->reach > o->reach_size) ||
        f->farthest > o->farthest)
        doubts |= 1u << APSM_DOUBT_ENDS;
    doubts |= (unsigned)(f->opposed > 0) << APSM_DOUBT_SIDE;
    return doubts;
}

bool apsm_verdict_tells(const apsm_findings *f, apsm_aspect aspect, const apsm_verdict_options *o)
{
    const apsm_turn *other = &f->turn[aspect == APSM_ASPECT_HAND];
    return other->evidence > o->told && other->staying > told_in_place;
}

double apsm_verdict_probability(const apsm_findings *f, const apsm_verdict_options *o)
{
    const double pose = f->turn[0].evidence, least = fmin(pose, f->turn[1].evidence);
    if (!(pose < -o->against || pose > least_pose)) return NAN;
    const double evidence = fmin(fmax(least, -most_against), most_evidence);
    const double agreement = fmin(f->agreement, most_agreement);
    const double p =
        1.0 / (1.0 + exp(-(at_nothing + by_evidence * evidence + by_agreement * agreement)));
    return fmin(fmax(p, least_probability), 1.0 - least_probability);
}

static bool is_settled(const apsm_findings *f, const apsm_turn *other, double least,
                       const apsm_verdict_options *o)
{
    return f->agreement > other->agreement + clearly && other->staying > 0.0 &&
           other->evidence > fmax(o->told, least);
}

static bool speaks_for_mirror(const apsm_findings *f)
{
    return f->turn[1].evidence < 0.0 || f->turn[1].agreement > f->agreement;
}

unsigned apsm_verdict_note_hand(const apsm_findings *f, double usual, bool undecided,
                                const apsm_verdict_options *o)
{
    if (f && is_settled(f, &f->turn[1], decisive * usual, o)) return 0;
    if (f && !undecided && usual < o->told && !speaks_for_mirror(f)) return 0;
    return 1u << (undecided ? APSM_DOUBT_HAND : APSM_DOUBT_MIRRORED);
}

unsigned apsm_verdict_note_pose(const apsm_findings *f, double usual, apsm_pose_note note,
                                const apsm_verdict_options *o)
{
    const bool against = note == APSM_POSE_AGAINST;
    const bool turned = f && f->turn[0].evidence < -o->against; /* is said by itself */
    const bool told = !f || fmin(usual, f->turn[0].evidence) > least_pose;
    if (f && is_settled(f, &f->turn[0], decisive_pose * usual, o) &&
        (!against || f->turn[0].evidence > against_others))
        return 0;
    if (note == APSM_POSE_SOUGHT && (told || turned)) return 0;
    return 1u << APSM_DOUBT_POSE;
}
