/* twin PROFILE.csv RECORD.csv [ROW [{SEED | noiseless} [full]]]: a run through a profile, row by row.
 *
 * The profile has the columns time_s and chamber_temperature_degC (housing_temperature_degC where the card was carried for
 * it), linear between its rows, and any of drive_amplitude_V, electrode_bias_V, quadrature_V, pattern_angle_deg and
 * rate_deg_per_s; a comment "# start: 2026-01-31T12:00:00+00:00" places the run in time (local without an offset).
 * `full` writes 17 digits. Exit status: 0 done, 2 unusable input. The record appears whole or not at all.
 */
#if defined __unix__ || defined __APPLE__
#define _XOPEN_SOURCE 700
#include <sys/stat.h>
#endif
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "twin.h"

enum { OFFERED = IN_PRECESSION, TIME = 0, BOUNDARY, FIRST_COMMAND, COLUMNS = FIRST_COMMAND + OFFERED, LONGEST_LINE = 4096, MOST_ROWS = 1000000000 };
static const char *const names[COLUMNS] = {"time_s", TWIN_BOUNDARY, "rate_deg_per_s", "drive_amplitude_V", "electrode_bias_V", "quadrature_V", "pattern_angle_deg"};

typedef struct { double (*rows)[COLUMNS]; long count, place; int has[COLUMNS]; double moment; char start[64]; } Profile;

static int complain(const char *file, long line, const char *what) {
    fprintf(stderr, line ? "%s, line %ld: " : "%s: ", file, line);
    fprintf(stderr, "%s\n", what);
    return 2;
}

/* Seconds since 1970 of an ISO 8601 time, local without an offset; 0 where it is none. */
static int read_moment(const char *text, double *moment) {
    struct tm at = {.tm_isdst = -1};
    int used = 0, minutes = 0, zone[2] = {0};
    char *end = NULL, sign = 0;
    double seconds = 0.0;
    if (sscanf(text, "%4d-%2d-%2d%n", &at.tm_year, &at.tm_mon, &at.tm_mday, &used) != 3) return 0;
    text += used;
    if (*text == 'T' || *text == ' ') {
        if (sscanf(++text, "%2d:%2d%n", &at.tm_hour, &at.tm_min, &used) != 2) return 0;
        text += used;
        if (*text == ':') seconds = strtod(text + 1, &end), text = end;
    }
    minutes = 60 * at.tm_hour + at.tm_min;
    const int leap = at.tm_year % 4 == 0 && (at.tm_year % 100 != 0 || at.tm_year % 400 == 0);
    const int longest = at.tm_mon == 2 ? 28 + leap : 30 + (at.tm_mon + at.tm_mon / 8) % 2;
    if (at.tm_mon < 1 || at.tm_mon > 12 || at.tm_mday < 1 || at.tm_mday > longest || minutes >= 1440 || at.tm_min > 59 || !(seconds >= 0 && seconds < 60)) return 0;
    if (!*text) { /* of the zone of this computer */
        at.tm_year -= 1900, at.tm_mon -= 1;
        return *moment = (double)mktime(&at) + seconds, 1;
    }
    if (strcmp(text, "Z") && (sscanf(text, "%c%2d:%2d%n", &sign, &zone[0], &zone[1], &used) != 3 || text[used] || (sign != '+' && sign != '-'))) return 0;
    const int y = at.tm_year - (at.tm_mon < 3), days = 365 * y + y / 4 - y / 100 + y / 400 + (153 * ((at.tm_mon + 9) % 12) + 2) / 5 + at.tm_mday - 719469;
    minutes -= (sign == '-' ? -1 : 1) * (60 * zone[0] + zone[1]);
    return *moment = 86400.0 * days + 60.0 * minutes + seconds, 1;
}

static int load(const char *file, Profile *profile) {
    FILE *in = fopen(file, "r");
    char line[LONGEST_LINE], said[128];
    int order[64], width = 0;
    long number = 0;
    if (!in) return complain(file, 0, "cannot be read.");
    while (fgets(line, sizeof line, in)) {
        int k = 0;
        double row[COLUMNS] = {0};
        ++number;
        line[strcspn(line, "\r\n")] = 0;
        if (number == 1 && !strncmp(line, "\xEF\xBB\xBF", 3)) memmove(line, line + 3, strlen(line) - 2); /* Excel's mark of UTF-8 */
        if (sscanf(line, "# start : %63[^\n]", profile->start) == 1) {
            for (size_t n = strlen(profile->start); n && profile->start[n - 1] == ' '; --n) profile->start[n - 1] = 0;
            if (!read_moment(profile->start, &profile->moment)) return fclose(in), complain(file, number, "'# start' is no ISO 8601 time such as 2026-01-31T12:00:00.");
        }
        if (!*line || *line == '#') continue;
        for (char *cell = line, *next = line; next && k < 64; cell = next, ++k) {
            next = strchr(cell, ',');
            if (next) *next++ = 0;
            if (!width || !profile->rows) {
                order[k] = -1;
                for (int c = 0; c < COLUMNS; ++c)
                    if (!strcmp(cell, names[c]) && !profile->has[c]) order[k] = c, profile->has[c] = 1;
                if (order[k] < 0) {
                    snprintf(said, sizeof said, "column '%.60s' is unknown, or there twice; main.c lists all.", cell);
                    return fclose(in), complain(file, number, said);
                }
            } else {
                char *end;
                const double value = strtod(cell, &end);
                if (k >= width || end == cell || *end || !isfinite(value)) return fclose(in), complain(file, number, "a cell is no number.");
                row[order[k]] = value;
            }
        }
        if (!width) {
            width = k;
            profile->rows = malloc(sizeof *profile->rows);
            if (!profile->rows || !profile->has[TIME] || !profile->has[BOUNDARY])
                return fclose(in), complain(file, number, "needs the columns time_s and " TWIN_BOUNDARY ".");
            continue;
        }
        if (k != width) return fclose(in), complain(file, number, "has fewer cells than the header.");
        if (profile->count && row[TIME] < profile->rows[profile->count - 1][TIME]) return fclose(in), complain(file, number, "time_s goes back.");
        void *more = realloc(profile->rows, (size_t)(profile->count + 1) * sizeof *profile->rows);
        if (!more) return fclose(in), complain(file, number, "not enough memory.");
        profile->rows = more;
        memcpy(profile->rows[profile->count++], row, sizeof row);
    }
    fclose(in);
    return profile->count > 1 ? 0 : complain(file, number, "a profile needs at least two rows.");
}

/* The value at a time, after a jump; the time never goes back. */
static double value_at(Profile *profile, double time, int column) {
    while (profile->place < profile->count - 2 && profile->rows[profile->place + 1][TIME] <= time) ++profile->place;
    const double *a = profile->rows[profile->place], *b = a + COLUMNS;
    return b[TIME] <= time ? b[column] : a[column] + (b[column] - a[column]) / (b[TIME] - a[TIME]) * (time - a[TIME]);
}

/* The value just after a time, and on that straight line where it bends, or at `until` where that is sooner. */
static double line_at(Profile *profile, double from, double *until, int column, double *last) {
    const double first = value_at(profile, from, column), *b = profile->rows[profile->place + 1], *a = b - COLUMNS;
    if (b[TIME] > from && b[TIME] < *until) *until = b[TIME];
    *last = first + (b[TIME] > a[TIME] ? (b[column] - a[column]) / (b[TIME] - a[TIME]) : 0.0) * (*until - from);
    return first;
}

/* Heat from one row to the next, in pieces between which the profile is straight. */
static const char *heat_to(Twin *twin, Profile *profile, double start, double time) {
    const char *fault = NULL;
    for (double now = start, until; now < time && !fault; now = until) {
        double last;
        until = time;
        const double first = line_at(profile, now, &until, BOUNDARY, &last);
        fault = twin_heat(twin, until - now, first + 273.15, last + 273.15);
    }
    return fault;
}

/* The mean of the applied rate until a time, and by how much it exceeds that meanwhile. */
static double mean_rate(Profile *profile, double time, double end, double *peak) {
    double sum = 0.0, most = 0.0, last = value_at(profile, time, FIRST_COMMAND);
    const double now = last;
    for (double from = time, until; from < end; from = until) {
        until = end;
        const double first = line_at(profile, from, &until, FIRST_COMMAND, &last);
        most = fmax(most, fmax(fabs(first), fabs(last)));
        sum += (until - from) * (first + last) / 2;
    }
    const double mean = end > time ? sum / (end - time) : now;
    *peak = fmax(most - fabs(mean), 0.0);
    return mean;
}

static double rates(void *course, double from, double *until, double *last) {
    Profile *profile = course;
    const double start = profile->rows[0][TIME];
    double end = start + *until;
    const double first = line_at(profile, start + from, &end, FIRST_COMMAND, last);
    if (end < start + *until) *until = fmax(end - start, nextafter(from, INFINITY));
    return first;
}

static const char *onward(Twin *twin, const void *way, double seconds) {
    Profile ahead = *(const Profile *)way;
    const double now = ahead.rows[0][TIME] + twin->time;
    return heat_to(twin, &ahead, now, now + seconds);
}

/* Commands whose columns stand among those of the loops. */
static int said_by_loops(int command) { return TWIN_LOOPS && (command == IN_QUADRATURE || command == IN_ANGLE); }

typedef struct { double time, boundary, out[TWIN_OUTPUTS]; TwinInput in; } Row;

static void print_row(FILE *out, const Row *row, int full) {
    fprintf(out, "%.*f", full ? 17 : 9, row->time);
    if (TWIN_SENSOR >= 0) fprintf(out, full ? ",%.17g" : ",%.6f", row->boundary);
    for (int k = 0; k < TWIN_OUTPUTS - 1; ++k)
        full ? fprintf(out, ",%.17g", row->out[k]) : fprintf(out, ",%.*f", twin_digits[k], row->out[k]);
    for (int c = 1; c < OFFERED; ++c)
        if (row->in.given[c] && !said_by_loops(c)) fprintf(out, full ? ",%.17g" : ",%.9f", row->in.value[c]);
    if (row->in.given[IN_RATE]) fprintf(out, full ? ",%.17g,%.17g" : ",%.9f,%.9f", row->in.value[IN_RATE], row->out[TWIN_OUTPUTS - 1]);
    fputc('\n', out);
}

#if TWIN_FREE
/* A row of a wave that turns freely has the means of the time that follows it, and the temperatures and the azimuth of its own. */
static void print_means(FILE *out, Row *row, const Twin *twin, int full) {
    static const int means[] = {OUT_frequency_Hz, OUT_bias_deg_per_h, OUT_inverse_q, OUT_quadrature_V};
    for (int k = 0; k < 4; ++k)
        if (means[k] != OUT_quadrature_V || !row->in.given[IN_QUADRATURE]) row->out[means[k]] = twin->out[means[k]];
    row->out[OUT_measured_rate_deg_per_s] = row->in.value[IN_RATE] + row->out[OUT_bias_deg_per_h] / 3600;
    print_row(out, row, full);
}
#endif

static int write_rows(Twin *twin, Profile *profile, FILE *out, double row, int full) {
    const double start = profile->rows[0][TIME], end = profile->rows[profile->count - 1][TIME];
    const long count = (long)floor((end - start) / row * (1 + 1e-12)) + 1;
    const char *fault = twin_settle(twin, profile->rows[0][BOUNDARY] + 273.15);
    Row here = {0};
    double now = start;
    twin->step = row;
    Profile along = *profile, ahead = *profile; /* of the rate, each with its own place */
    twin->onward = onward;
    twin->way = profile;
    if (profile->has[FIRST_COMMAND]) twin->rates = rates, twin->course = &along;
    fprintf(out, "# instrument: %s\n# source: simulated\n", TWIN_NAME);
    if (*profile->start) fprintf(out, "# start: %s\n", profile->start);
    fprintf(out, "time_s%s", TWIN_SENSOR >= 0 ? "," TWIN_BOUNDARY : "");
    for (int k = 0; k < TWIN_OUTPUTS - 1; ++k)
        fprintf(out, ",%s", twin_columns[k]);
    for (int c = FIRST_COMMAND + 1; c < COLUMNS; ++c)
        if (profile->has[c] && !said_by_loops(c - FIRST_COMMAND)) fprintf(out, ",%s", names[c]);
    if (profile->has[FIRST_COMMAND]) fprintf(out, ",%s,%s", names[FIRST_COMMAND], twin_columns[TWIN_OUTPUTS - 1]);
    fputc('\n', out);
    for (long n = 0; n < count && !fault; ++n) {
        const double time = fmin(start + (double)n * row, end);
        fault = heat_to(twin, profile, now, time);
        twin->time = time - start;
        now = time;
        TwinInput in = {{0}, {0}};
        for (int c = 0; c < OFFERED; ++c) {
            in.given[c] = profile->has[FIRST_COMMAND + c];
            in.value[c] = value_at(profile, time, FIRST_COMMAND + c);
        }
        in.value[IN_RATE] = mean_rate(&ahead, time, n + 1 < count ? fmin(start + (double)(n + 1) * row, end) : time, &twin->peak);
        const double boundary = value_at(profile, time, BOUNDARY);
        if (n == 0) twin->boundary = boundary + 273.15;
        if (!fault) fault = twin_row(twin, &in);
        if (!fault && twin->actuator_use > 1) fault = "the settled loops need more than the actuators give; lower the rate or raise the ranges of [loop].";
        if (fault) break;
#if TWIN_FREE
        if (n > 0) print_means(out, &here, twin, full);
#endif
        here = (Row){.time = time, .boundary = boundary, .in = in};
        memcpy(here.out, twin->out, sizeof here.out);
        if (TWIN_LOOPS && in.given[IN_QUADRATURE]) here.out[TWIN_QUADRATURE] = in.value[IN_QUADRATURE];
        if (!TWIN_FREE) print_row(out, &here, full);
    }
#if TWIN_FREE
    twin_last_row(twin);
    if (!fault) print_means(out, &here, twin, full);
#endif
    return fault ? (fprintf(stderr, "at %g s: %s\n", now, fault), 2) : 0;
}

static int is_file(const char *path) {
#ifdef _XOPEN_SOURCE
    struct stat about;
    return stat(path, &about) || S_ISREG(about.st_mode); /* one that is not there will be */
#else
    return path != NULL;
#endif
}

static int are_one(const char *path, const char *other) {
#ifdef _XOPEN_SOURCE
    struct stat one, two;
    if (!stat(path, &one) && !stat(other, &two)) return one.st_dev == two.st_dev && one.st_ino == two.st_ino;
#endif
    return !strcmp(path, other);
}

/* Write a record beside its place and rename it when it is whole; what is no file, such as /dev/stdout, is written as it is. */
static int write_record(Twin *twin, Profile *profile, const char *from, const char *to, double row, int full) {
    char part[LONGEST_LINE];
    char *real = NULL; /* behind links */
#ifdef _XOPEN_SOURCE
    real = realpath(to, NULL);
#endif
    const char *place = real ? real : to;
    const int moves = is_file(place);
    int status = snprintf(part, sizeof part, moves ? "%s.part" : "%s", place) < LONGEST_LINE ? 0 : 2;
    if (moves && (are_one(from, place) || are_one(from, part))) return free(real), complain(to, 0, "is read as the profile; give the record another name.");
    FILE *out = status ? NULL : fopen(part, "w");
    if (!out) return free(real), complain(to, 0, "cannot be written.");
    status = write_rows(twin, profile, out, row, full);
    const int failed = ferror(out);
    if ((fclose(out) || failed) && !status) status = complain(to, 0, "cannot be written.");
    if (moves && !status && rename(part, place) && (remove(place), rename(part, place))) status = complain(to, 0, "cannot be written.");
    if (moves && status) remove(part);
    free(real);
    return status;
}

int main(int argc, char **argv) {
    Profile profile = {0};
    char *end = NULL;
    const double row = argc > 3 ? strtod(argv[3], &end) : 1.0;
    const int noise = !(argc > 4 && !strcmp(argv[4], "noiseless")), full = argc > 5;
    const size_t digits = noise && argc > 4 ? strspn(argv[4], "0123456789") : 1;
    const int said = argc < 3 || argc > 6 || (end && (end == argv[3] || *end)) || !(row > 0) || !isfinite(row) || digits < 1 || digits > 15
                     || (noise && argc > 4 && argv[4][digits]) || (full && strcmp(argv[5], "full"));
    if (said) return fprintf(stderr, "usage: twin PROFILE.csv RECORD.csv [ROW [{SEED | noiseless} [full]]]; ROW: seconds, 1 unless given; SEED: a whole number, 0 unless given\n"), 2;
    Twin *twin = malloc(sizeof *twin);
    int status = twin ? load(argv[1], &profile) : 2;
    if (!status && TWIN_FREE && profile.has[FIRST_COMMAND + IN_ANGLE])
        status = complain(argv[1], 1, "the wave of this card turns freely; leave out the column pattern_angle_deg.");
    if (!status && (profile.rows[profile.count - 1][TIME] - profile.rows[0][TIME]) / row > MOST_ROWS) status = complain(argv[1], 0, "too many rows; raise row.");
    if (!status) {
        twin_defaults(twin);
        twin->noise = noise;
        twin->p[P_start_s] = profile.moment;
        twin_seed(twin, noise && argc > 4 ? strtoull(argv[4], NULL, 10) : 0);
        status = write_record(twin, &profile, argv[1], argv[2], row, full);
    }
    free(profile.rows);
    free(twin);
    return status;
}
