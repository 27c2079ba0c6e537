/* A loop in C: the run of an input file, and the force of the grains on one of its boundaries at the end. loop.md says how it is built. */
#include <gravier.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>

static int end(int status)
{
    if (gravier_error()[0] != '\0')
        fprintf(stderr, "loop: error: %s\n", gravier_error());
    gravier_finalize();
    return status;
}

int main(int count, char **words)
{
    gravier_simulation *s;
    int64_t goes_on, step, rank;
    double force[3] = {0.0, 0.0, 0.0};
    int wall, n, status;

    if (count != 3) {
        fprintf(stderr, "usage: loop CASE.nml BOUNDARY\n");
        return 2;
    }
    status = gravier_open(words[1], "loop", 0, NULL, &s);
    if (status != 0)
        return end(status);
    status = gravier_boundary(s, words[2], &wall);
    gravier_whole(s, "goes_on", &goes_on);
    while (status == 0 && goes_on) {
        status = gravier_step(s);
        gravier_whole(s, "goes_on", &goes_on);
    }
    if (status != 0) {
        fprintf(stderr, "loop: error: %s\n", gravier_error());
        return end(gravier_close(s));
    }
    gravier_get_boundary(s, wall, "force", force, &n);
    gravier_whole(s, "step", &step);
    gravier_whole(s, "rank", &rank);
    status = gravier_close(s);
    if (rank == 0)
        printf("%d steps, the grains press %s with %.3f N\n", (int)step, words[2],
               sqrt(force[0] * force[0] + force[1] * force[1] + force[2] * force[2]));
    return end(status);
}
