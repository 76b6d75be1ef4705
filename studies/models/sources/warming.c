typedef struct { double low, high; int way, begun; } hrg_course;

/* Output without what differs by warming and cooling, for hrg_rate; set course.begun = 0 before the first row. */
double hrg_undo_warming(hrg_course *course, double output, double temperature_degC) {
    double T = temperature_degC;
    if (!course->begun) { course->low = course->high = T; course->way = 0; course->begun = 1; }
    course->low = fmin(course->low, T);
    course->high = fmax(course->high, T);
    if (course->way < 1 && T - course->low > $turn) { course->way = 1; course->high = T; }
    else if (course->way > -1 && course->high - T > $turn) { course->way = -1; course->low = T; }
    return (output - course->way * ($shift)) / (1.0 + course->way * ($gain));
}
