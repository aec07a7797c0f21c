/* Rays that turn with the shape [M 6.1], so that one ray follows one feature through all slices. */
#ifndef LATHE_TWIST_H
#define LATHE_TWIST_H
#include "sections.h"

typedef enum lathe_twist_method { LATHE_TWIST_NONE, LATHE_TWIST_FIXED, LATHE_TWIST_AUTO } lathe_twist_method;
typedef struct lathe_twist {
    lathe_twist_method method;
    double degrees; /* FIXED: from each section to the next, counter-clockwise */
} lathe_twist;

/* "none", "auto", or degrees (-180 to 180, as strtod reads them). FORMAT: anything else, *out untouched, err (may be
 * NULL) says what is taken. */
lathe_status lathe__parse_twist(lathe_twist *out, const char *text, lathe_error *err);

/* turn[k]: where the first ray of section k points, 1/65536 of a full turn; turn[0] = 0. degrees: NULL, or gets count
 * entries: what section k is turned against section k - 1.
 * AUTO: the radius profiles (farthest border point in 720 directions from the centroid) of two neighbours' largest
 * loops are correlated for every turn up to 45 degrees; the peak is found to a fraction of a direction. Turns are
 * believed only if they halve what the profiles differ by and agree with those of the slices around, else 0: a body
 * that grows, bends or shrinks is not turned. Turns add up from section to section. A section without loops is not
 * turned. O(points + 720 * 181) each. MEMORY. */
lathe_status lathe__choose_turns(uint32_t *turn, double *degrees, const lathe_section *sections, uint32_t count,
                                 const lathe_twist *twist);

/* The same for every loop, as lathe_reconstruct_options.turns wants them: (*out)[section][loop], arena memory.
 * MEMORY. */
lathe_status lathe__turn_sections(uint32_t ***out, lathe_arena *arena, const lathe_section *sections, uint32_t count,
                                  const lathe_twist *twist);
#endif
