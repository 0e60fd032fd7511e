// The machine of the example: a host.
#include "print_line.h"

#include <stdio.h>

void print_line(const char *text) { puts(text); }
