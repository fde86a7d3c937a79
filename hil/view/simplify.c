/* The swinging door: `hil.view.packed.swinging_door` in C. Marks the samples that are kept. */

#include <math.h>
#include <stdint.h>

void swinging_door(const double *t, const double *x, int64_t n, double tolerance, uint8_t *kept) {
    int64_t begin = 0;
    double low = -INFINITY, high = INFINITY;
    kept[0] = kept[n - 1] = 1;
    for (int64_t i = 1; i < n; i++) {
        double way = t[i] - t[begin], slope = (x[i] - x[begin]) / way;
        if (way > 0 && !(low <= slope && slope <= high)) {
            begin = i - 1, low = -INFINITY, high = INFINITY;
            kept[begin] = 1;
            way = t[i] - t[begin];
        }
        if (way > 0) {
            double lowest = (x[i] - tolerance - x[begin]) / way;
            double highest = (x[i] + tolerance - x[begin]) / way;
            low = lowest > low ? lowest : low;
            high = highest < high ? highest : high;
        }
    }
}
