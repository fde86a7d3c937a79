/* The Newton-Euler recursion: one pass outwards gives every column of the regressor.

For each sample the pass carries from link to link the motion of the frame (angular velocity w,
angular acceleration u, acceleration a of the origin less gravity) and, seen in that frame, the axes
of the joints that move it: all joints before in a chain, those on the way from the base in a tree,
where each further branch goes on from a copy. The wrench about the origin that one unit of a standard parameter needs to
follow that motion is

    inertia I        n = I u + w x I w    f = 0
    first moment s   n = s x a            f = u x s + w x (w x s)
    mass             n = 0                f = a

and its torque on joint i is the product with that joint's axis (angular z, linear z x arm; for a
prismatic joint linear z alone). So no pass inwards is needed, only the columns of those standard
parameters that carry base parameters are computed, and single rows come cheap. `torques` goes the
same way but weighs the wrenches of a link with given values before the product.

Samples go through in blocks of LANES, a vector per component. Nothing is reordered or contracted,
so each processor gives the same bits, and those of hil/model/recursion_by_arrays.py. `state` has
the shape (5, n, joints): cosine and sine of the angle about each joint's axis, shift along it,
velocity, acceleration; `frames` (joints, 4): cos(alpha), sin(alpha), d, 1 for a revolute or 0 for a
prismatic joint; `parents` (joints): the joint that carries each one, before it, or -1. */

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#define LANES 4
typedef double V __attribute__((vector_size(LANES * sizeof(double))));
typedef int64_t I __attribute__((vector_size(LANES * sizeof(int64_t))));
typedef struct { V x, y, z; } Vector;
typedef struct { Vector w, u, a; } Motion;
typedef struct { Vector turn, slide; } Axis;
typedef struct { V c, s, shift, qd, qdd; } Joint;

#if defined(__x86_64__) && defined(__gnu_linux__) && defined(__GNUC__) && !defined(__clang__)
#define FOR_ANY_PROCESSOR __attribute__((target_clones("avx2", "default")))
#else
#define FOR_ANY_PROCESSOR
#endif
#define PART static inline __attribute__((always_inline))

PART V all(double x) { return x - (V){0}; }

PART V product(const Vector *a, const Vector *b) { return a->x * b->x + a->y * b->y + a->z * b->z; }

/* Turn a vector of the parent's frame into the joint's own. */
PART Vector turned(double ca, double sa, const Joint *now, const Vector *v) {
    V h = ca * v->y + sa * v->z;
    return (Vector){now->c * v->x + now->s * h, now->c * h - now->s * v->x, ca * v->z - sa * v->y};
}

/* Cosine and sine of the joints' angles, and the shifts, into state (3, n, joints).

    Angles are theta + revolute q, shifts r + (1 - revolute) q. Returns 1 where an angle is beyond
    2^20 rad or no number: others are right within some two units in the last place.

    What is left of an angle by the nearest multiple of a quarter turn, which is taken off in three
    parts so that nothing is lost, goes into Taylor's series; the multiple says which of the two is
    which, and their signs. */
#define SERIES(sum, z, ...)                                                                 \
    do {                                                                                    \
        const double terms[] = {__VA_ARGS__};                                              \
        for (int k = sizeof terms / sizeof *terms - 1; k >= 0; k--) sum = terms[k] + z * sum;  \
    } while (0)

PART V rounded(V x) { return (x + all(0x1.8p52)) - all(0x1.8p52); }

PART V chosen(I mask, V a, V b) { return (V)(((I)a & mask) | ((I)b & ~mask)); }

FOR_ANY_PROCESSOR
int positions(const double *q, const double *theta, const double *r, const double *revolute,
              int64_t n, int64_t joints, double *state) {
    I beyond = {0};
    int64_t joint = 0, every = n * joints;
    for (int64_t first = 0; first < every; first += LANES) {
        int64_t count = every - first < LANES ? every - first : LANES;
        int64_t size = count * sizeof(double);
        V x = all(0), c = all(0), s = all(0), shift = all(0);
        for (int i = 0; i < count; i++, joint = joint + 1 < joints ? joint + 1 : 0) {
            x[i] = theta[joint] + revolute[joint] * q[first + i];
            shift[i] = r[joint] + (1.0 - revolute[joint]) * q[first + i];
        }
        beyond |= ~((x <= 0x1p20) & (x >= -0x1p20));
        V quarters = rounded(x * 0x1.45f306dc9c883p-1);
        x -= quarters * 0x1.921fb544p+0;
        x -= quarters * 0x1.0b4611a6p-34;
        x -= quarters * 0x1.3198a2e037073p-69;
        V z = x * x, half = 0.5 * z, one = 1.0 - half;
        SERIES(s, z, -0.16666666666666666, 0.008333333333333333, -0.0001984126984126984,
               2.7557319223985893e-06, -2.505210838544172e-08, 1.6059043836821613e-10,
               -7.647163731819816e-13);
        SERIES(c, z, 0.041666666666666664, -0.001388888888888889, 2.48015873015873e-05,
               -2.755731922398589e-07, 2.08767569878681e-09, -1.1470745597729725e-11,
               4.779477332387385e-14, -1.5619206968586225e-16);
        s = x + x * z * s;
        c = one + (((1.0 - one) - half) + z * z * c);
        V part = 0.25 * quarters - rounded(0.25 * quarters);  /* of a turn: 0, +-0.25, +-0.5 */
        I odd = (part == 0.25) | (part == -0.25);
        V a = chosen(odd, s, c), b = chosen(odd, c, s);
        a = chosen((part > 0.0) | (part == -0.5), -a, a);
        b = chosen((part < 0.0) | (part == 0.5), -b, b);
        memcpy(state + first, &a, size);
        memcpy(state + every + first, &b, size);
        memcpy(state + 2 * every + first, &shift, size);
    }
    for (int i = 1; i < LANES; i++) beyond[0] |= beyond[i];
    return beyond[0] != 0;
}

PART Joint gathered(const double *state, int64_t n, int64_t joints, int64_t first, int64_t count,
                    int64_t joint) {
    Joint now;
    V *parts = (V *)&now;
    for (int k = 0; k < 5; k++)
        for (int i = 0; i < LANES; i++)  /* lanes beyond the end repeat the first one */
            parts[k][i] = state[(k * n + first + (i < count ? i : 0)) * joints + joint];
    return now;
}

/* Go from a parent to a link: turn the motion into its frame, add the joint's own. */
PART void carry_motion(const double *joint, const Joint *now, Motion *m) {
    double ca = joint[0], sa = joint[1], d = joint[2], revolute = joint[3];
    Vector w = m->w, u = m->u;
    V px = all(d), py = -sa * now->shift, pz = ca * now->shift;
    V xx = w.x * w.x, yy = w.y * w.y, zz = w.z * w.z, xy = w.x * w.y, xz = w.x * w.z, yz = w.y * w.z;
    Vector a = {m->a.x + (-(yy + zz) * px + (xy - u.z) * py + (xz + u.y) * pz),
                m->a.y + ((xy + u.z) * px - (xx + zz) * py + (yz - u.x) * pz),
                m->a.z + ((xz - u.y) * px + (yz + u.x) * py - (xx + yy) * pz)};
    w = turned(ca, sa, now, &w), u = turned(ca, sa, now, &u), a = turned(ca, sa, now, &a);
    V spin = revolute * now->qd, slide = (1.0 - revolute) * 2.0 * now->qd;
    m->w = (Vector){w.x, w.y, w.z + spin};
    m->u = (Vector){u.x + w.y * spin, u.y - w.x * spin, u.z + revolute * now->qdd};
    m->a = (Vector){a.x + w.y * slide, a.y - w.x * slide, a.z + (1.0 - revolute) * now->qdd};
}

PART void carry_axis(const double *joint, const Joint *now, Axis *axis) {
    double ca = joint[0], sa = joint[1], d = joint[2];
    V px = all(d), py = -sa * now->shift, pz = ca * now->shift;
    Vector t = axis->turn, s = axis->slide;
    s.x += t.y * pz - t.z * py;
    s.y += t.z * px - t.x * pz;
    s.z += t.x * py - t.y * px;
    axis->turn = turned(ca, sa, now, &t);
    axis->slide = turned(ca, sa, now, &s);
}

PART Axis new_axis(double revolute) {
    return (Axis){{all(0), all(0), all(revolute)}, {all(0), all(0), all(1.0 - revolute)}};
}

PART Motion at_rest(const double *gravity) {
    Motion m;
    memset(&m, 0, sizeof m);
    m.a = (Vector){all(-gravity[0]), all(-gravity[1]), all(-gravity[2])};
    return m;
}

/* Of each link, the base at index -1: the number of those `rows` that move it, these rows, and whether
   another branch goes on from it later, from the copy in `kept`. */
typedef struct {
    int chain;
    int64_t n_rows, *moving, *paths, *forks;
    V *kept;
} Tree;

#define SIZE_OF_COPY(n_rows) (9 + 6 * (n_rows))
#define SIZE_OF_TREE(joints, n_rows) ((joints + 1) * (SIZE_OF_COPY(n_rows) + 2 + (n_rows)))

PART int is_chain(const int64_t *parents, int64_t joints) {
    int64_t link = 0;
    while (link < joints && parents[link] == link - 1) link++;
    return link == joints;
}

PART Tree tree_in(V *memory, int chain, const int64_t *parents, const int64_t *rows, int64_t joints,
                  int64_t n_rows) {
    V *kept = memory + SIZE_OF_COPY(n_rows);
    int64_t *moving = (int64_t *)(memory + (joints + 1) * SIZE_OF_COPY(n_rows)) + 1;
    Tree tree = {chain, n_rows, moving, moving + 2 * joints + 1, moving + joints + 1, kept};
    if (chain) return tree;
    memset(moving - 1, 0, 2 * (joints + 1) * sizeof *moving);
    for (int64_t link = 0, row = 0; link < joints; link++) {
        int64_t parent = parents[link], count = moving[parent], *path = tree.paths + link * n_rows;
        memcpy(path, tree.paths + parent * n_rows, count * sizeof *path);
        if (!rows || (row < n_rows && rows[row] == link)) path[count++] = row++;
        moving[link] = count;
        tree.forks[parent] |= parent + 1 < link;
    }
    return tree;
}

PART void keep(const Tree *tree, int64_t link, const Motion *motion, const Axis *axes) {
    if (tree->chain || !tree->forks[link]) return;
    V *copy = tree->kept + link * SIZE_OF_COPY(tree->n_rows);
    memcpy(copy, motion, sizeof *motion);
    memcpy(copy + 9, axes, tree->moving[link] * sizeof *axes);
}

PART void restore(const Tree *tree, int64_t link, Motion *motion, Axis *axes) {
    if (tree->chain) return;
    const V *copy = tree->kept + link * SIZE_OF_COPY(tree->n_rows);
    memcpy(motion, copy, sizeof *motion);
    memcpy(axes, copy + 9, tree->moving[link] * sizeof *axes);
}

/* Moment and force that one unit of a standard parameter of place `kind` in eq. (4) needs. */
PART void unit_wrench(int64_t kind, const Motion *m, Vector *moment, Vector *force) {
    Vector w = m->w, u = m->u, a = m->a, n = {all(0), all(0), all(0)}, f = n;
    V zero = all(0);
    switch (kind) {
    case 0: n = (Vector){u.x, w.x * w.z, -w.x * w.y}; break;
    case 1: n = (Vector){u.y - w.x * w.z, u.x + w.y * w.z, w.x * w.x - w.y * w.y}; break;
    case 2: n = (Vector){u.z + w.x * w.y, w.z * w.z - w.x * w.x, u.x - w.y * w.z}; break;
    case 3: n = (Vector){-w.y * w.z, u.y, w.x * w.y}; break;
    case 4: n = (Vector){w.y * w.y - w.z * w.z, u.z - w.x * w.y, u.y + w.x * w.z}; break;
    case 5: n = (Vector){w.y * w.z, -w.x * w.z, u.z}; break;
    case 6:
        n = (Vector){zero, -a.z, a.y};
        f = (Vector){-w.y * w.y - w.z * w.z, w.x * w.y + u.z, w.x * w.z - u.y};
        break;
    case 7:
        n = (Vector){a.z, zero, -a.x};
        f = (Vector){w.x * w.y - u.z, -w.x * w.x - w.z * w.z, w.y * w.z + u.x};
        break;
    case 8:
        n = (Vector){-a.y, a.x, zero};
        f = (Vector){w.x * w.z + u.y, w.y * w.z - u.x, -w.x * w.x - w.y * w.y};
        break;
    default: f = a;
    }
    *moment = n, *force = f;
}

#define MIX(a, b, ...) __builtin_shuffle(a, b, (I){__VA_ARGS__})

/* Write `size` vectors so that each lane's values lie in one piece, `count` pieces. */
PART void scatter(const V *tile, int64_t size, int64_t count, double *out) {
    int64_t m = 0;
#ifndef __clang__
    for (; count == LANES && m + 4 <= size; m += 4) {
        const V *t = tile + m;
        V a = MIX(t[0], t[1], 0, 4, 2, 6), b = MIX(t[0], t[1], 1, 5, 3, 7);
        V c = MIX(t[2], t[3], 0, 4, 2, 6), d = MIX(t[2], t[3], 1, 5, 3, 7);
        V lanes[4] = {MIX(a, c, 0, 1, 4, 5), MIX(b, d, 0, 1, 4, 5),
                      MIX(a, c, 2, 3, 6, 7), MIX(b, d, 2, 3, 6, 7)};
        for (int h = 0; h < LANES; h++) memcpy(out + h * size + m, lanes + h, sizeof(V));
    }
#endif
    for (; m < size; m++)
        for (int64_t i = 0; i < count; i++) out[i * size + m] = tile[m][i];
}

/* The pass over all samples: columns, or with `values` torques on all joints (`rows` is null). */
PART int pass(int chain, const double *state, const double *frames, const int64_t *parents,
              const double *gravity, const int64_t *kinds, const int64_t *links,
              const int64_t *rows, const double *values, int64_t n, int64_t joints,
              int64_t n_columns, int64_t n_rows, double *out) {
    int64_t each = values ? 1 : n_columns, size = n_rows * each;
    size_t needed = size + 6 * n_rows + SIZE_OF_TREE(joints, n_rows);
    V *tile;
    if (posix_memalign((void **)&tile, sizeof(V), needed * sizeof(V))) return 1;
    Axis *axes = (Axis *)(tile + size);
    Tree tree = tree_in(tile + size + 6 * n_rows, chain, parents, rows, joints, n_rows);
    memset(tile, 0, size * sizeof(V));  /* a joint knows nothing of links that it does not move */
    for (int64_t first = 0; first < n; first += LANES) {
        int64_t count = n - first < LANES ? n - first : LANES, column = 0, moving = 0;
        Motion motion = at_rest(gravity);
        if (values) memset(tile, 0, size * sizeof(V));
        keep(&tree, -1, &motion, axes);
        for (int64_t link = 0; link < joints; link++) {
            const double *frame = frames + 4 * link;
            const int64_t parent = parents[link], *path = tree.paths + link * n_rows;
            Joint now = gathered(state, n, joints, first, count, link);
            if (!chain && parent + 1 < link) restore(&tree, parent, &motion, axes);
            if (!chain) moving = tree.moving[parent];
            if (chain && !rows) moving = link;
            carry_motion(frame, &now, &motion);
            for (int64_t k = 0; k < moving; k++) carry_axis(frame, &now, axes + k);
            if (!rows || (chain ? moving < n_rows && rows[moving] == link : moving < tree.moving[link]))
                axes[moving++] = new_axis(frame[3]);
            keep(&tree, link, &motion, axes);
            Axis total;
            memset(&total, 0, sizeof total);
            for (; column < n_columns && links[column] == link; column++) {
                Vector moment, force;
                unit_wrench(kinds[column], &motion, &moment, &force);
                if (values) {
                    double value = values[column];
                    total.turn.x += value * moment.x, total.turn.y += value * moment.y;
                    total.turn.z += value * moment.z, total.slide.x += value * force.x;
                    total.slide.y += value * force.y, total.slide.z += value * force.z;
                } else
                    for (int64_t k = 0; k < moving; k++) {
                        V torque = product(&moment, &axes[k].turn);
                        if (kinds[column] >= 6) torque += product(&force, &axes[k].slide);
                        tile[(chain ? k : path[k]) * n_columns + column] = torque;
                    }
            }
            for (int64_t k = 0; values && k < moving; k++)
                tile[chain ? k : path[k]] +=
                    product(&total.turn, &axes[k].turn) + product(&total.slide, &axes[k].slide);
        }
        scatter(tile, size, count, out + first * size);
    }
    free(tile);
    return 0;
}

/* Torque on the joints `rows` (rising) per unit of standard parameters, into out (n, rows, columns).
   `kinds`, `links`: place in eq. (4) and link of each column; links never decrease. Returns 0, or 1
   where memory is short. */
FOR_ANY_PROCESSOR
int columns(const double *state, const double *frames, const int64_t *parents, const double *gravity,
            const int64_t *kinds, const int64_t *links, const int64_t *rows, int64_t n,
            int64_t joints, int64_t n_columns, int64_t n_rows, double *out) {
    return is_chain(parents, joints)
        ? pass(1, state, frames, parents, gravity, kinds, links, rows, 0, n, joints, n_columns, n_rows, out)
        : pass(0, state, frames, parents, gravity, kinds, links, rows, 0, n, joints, n_columns, n_rows, out);
}

/* Torque on all joints with standard parameters of given `values`, into out (n, joints). */
FOR_ANY_PROCESSOR
int torques(const double *state, const double *frames, const int64_t *parents, const double *gravity,
            const int64_t *kinds, const int64_t *links, const double *values, int64_t n,
            int64_t joints, int64_t n_columns, double *out) {
    return pass(0, state, frames, parents, gravity, kinds, links, 0, values, n, joints, n_columns, joints, out);
}
