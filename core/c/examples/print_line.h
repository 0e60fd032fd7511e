// The one thing that the example asks of the machine it runs on.
#ifndef PRINT_LINE_H
#define PRINT_LINE_H

// Prints a line.
void print_line(const char *text);

#endif
