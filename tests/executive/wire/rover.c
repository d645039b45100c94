/* A rover on the wire in C99 and POSIX alone, written from docs/reference/wire.md: it waits, and refuses the rest.
 *
 *     cc -O1 -o rover rover.c -lm && ./rover /tmp/rover.sock
 *
 * One thread; one executive at a time; everything it says is kept as text until it is durable.
 */
#define _POSIX_C_SOURCE 200809L
#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <poll.h>
#include <stdarg.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>

enum { LIMIT = 1 << 20, LINES = 8, COMMANDS = 4096, EVENTS = 65536, ID = 600 };

/* ---- JSON: a value is a place in the text; nothing is copied */

static const char *skip_space(const char *s) { while (isspace((unsigned char)*s)) s++; return s; }

static const char *skip(const char *s, int depth) { /* behind a value, NULL if it is none */
  s = skip_space(s);
  if (depth > 64) return NULL;
  if (*s == '"') {
    for (s++; *s && *s != '"'; s++) if (*s == '\\' && s[1]) s++;
    return *s == '"' ? s + 1 : NULL;
  }
  if (*s == '{' || *s == '[') {
    char close = *s == '{' ? '}' : ']';
    int object = *s == '{';
    s = skip_space(s + 1);
    if (*s == close) return s + 1;
    for (;;) {
      if (object) {
        if (*(s = skip_space(s)) != '"' || !(s = skip(s, depth + 1))) return NULL;
        s = skip_space(s);
        if (*s++ != ':') return NULL;
      }
      if (!(s = skip(s, depth + 1))) return NULL;
      s = skip_space(s);
      if (*s == close) return s + 1;
      if (*s++ != ',') return NULL;
    }
  }
  const char *begin = s;
  while (*s && !strchr(",]} \t\r\n", *s)) s++;
  return s > begin ? s : NULL;
}

static const char *member(const char *object, const char *name) { /* value of a member, NULL if absent */
  size_t length = strlen(name);
  const char *s = object ? skip_space(object) : "";
  if (*s != '{') return NULL;
  s = skip_space(s + 1);
  while (*s == '"') {
    const char *key = s + 1, *after = skip(s, 0);
    if (!after) return NULL;
    int same = (size_t)(after - key) == length + 1 && !strncmp(key, name, length);
    s = skip_space(after);
    if (*s++ != ':') return NULL;
    s = skip_space(s);
    if (same) return s;
    if (!(s = skip(s, 0))) return NULL;
    s = skip_space(s);
    if (*s == ',') s = skip_space(s + 1);
  }
  return NULL;
}

static int is(const char *value, const char *text) {
  size_t n = strlen(text);
  return value && value[0] == '"' && !strncmp(value + 1, text, n) && value[n + 1] == '"';
}

static int copy(const char *value, char *out, size_t room) { /* a value as it stands in the text */
  const char *end = value ? skip(value, 0) : NULL;
  if (!end || (size_t)(end - value) >= room) return 0;
  memcpy(out, value, (size_t)(end - value));
  out[end - value] = 0;
  return 1;
}

static long long whole(const char *value) { return value ? strtoll(value, NULL, 10) : 0; }

/* ---- the rover */

typedef struct { char id[ID]; int done; long long end; char answer[ID + 300]; } command_t;
typedef struct { long long number; char *text; } event_t; /* text: the event behind its number */
typedef struct { int fd; unsigned char *data; size_t size; } line_t;

static command_t commands[COMMANDS];
static int command_count, active = -1, event_count;
static event_t events[EVENTS];
static line_t lines[LINES];
static long long boot, last;
static char run[ID];

static long long clock_ms(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (long long)t.tv_sec * 1000 + t.tv_nsec / 1000000;
}

static void put(int fd, const char *format, ...) {
  static char body[LIMIT];
  va_list arguments;
  va_start(arguments, format);
  int size = vsnprintf(body + 4, sizeof body - 4, format, arguments);
  va_end(arguments);
  if (fd < 0 || size <= 0 || size >= (int)sizeof body - 4) return;
  for (int k = 0; k < 4; k++) body[k] = (char)((unsigned)size >> (24 - 8 * k));
  for (size_t at = 0; at < (size_t)size + 4;) {
    ssize_t sent = send(fd, body + at, (size_t)size + 4 - at, MSG_NOSIGNAL);
    if (sent <= 0) { if (fd == active) active = -1; return; }
    at += (size_t)sent;
  }
}

static void tell(const event_t *event) {
  put(active, "{\"m\":\"event\",\"event\":{\"number\":%lld,%s}", event->number, event->text);
}

static void again(long long number) {
  for (int k = 0; k < event_count; k++) if (events[k].number > number) tell(&events[k]);
}

static void say(const char *format, ...) {
  static char text[4096];
  va_list arguments;
  va_start(arguments, format);
  vsnprintf(text, sizeof text, format, arguments);
  va_end(arguments);
  if (event_count == EVENTS) { fprintf(stderr, "too much that is not durable\n"); exit(1); }
  events[event_count].number = ++last;
  events[event_count].text = strdup(text);
  tell(&events[event_count++]);
}

static void forget(long long number) {
  int gone = 0;
  while (gone < event_count && events[gone].number <= number) free(events[gone++].text);
  memmove(events, events + gone, (size_t)(event_count - gone) * sizeof *events);
  event_count -= gone;
}

static const char *state(void) {
  static char text[200];
  snprintf(text, sizeof text, "{\"heartbeat\":%.3f,\"wheel-speed\":0}", (double)clock_ms() / 1000);
  return text;
}

static command_t *find(const char *id) {
  for (int k = 0; k < command_count; k++) if (!strcmp(commands[k].id, id)) return &commands[k];
  return NULL;
}

static command_t *add(const char *id) {
  if (command_count == COMMANDS) { fprintf(stderr, "too many commands\n"); exit(1); }
  command_t *new = &commands[command_count++];
  memset(new, 0, sizeof *new);
  strcpy(new->id, id);
  return new;
}

static void over(command_t *command, const char *how) { /* how: kind and members of the event */
  command->done = 1;
  snprintf(command->answer, sizeof command->answer, "%s,\"t\":%lld,\"command\":%s,\"updates\":{}", how,
           clock_ms(), command->id);
  say("%s}", command->answer);
}

static int is_idle(void) {
  for (int k = 0; k < command_count; k++) if (!commands[k].done) return 0;
  return 1;
}

static void hello(const char *m, int fd) {
  char wanted[ID];
  long long have = whole(member(m, "have"));
  if (!copy(member(m, "run"), wanted, sizeof wanted)) return;
  if (strcmp(wanted, run)) {
    if (*run && !is_idle()) { put(fd, "{\"m\":\"bye\",\"reason\":\"busy with the run %.80s\"}", "before"); return; }
    if (*run || !have) {
      forget(last);
      boot = last;
      say("\"e\":\"update\",\"t\":%lld,\"values\":%s}", clock_ms(), state());
    }
    strcpy(run, wanted);
  }
  if (have > last) {
    long long shift = have - boot;
    boot += shift;
    last += shift;
    for (int k = 0; k < event_count; k++) events[k].number += shift;
  }
  active = fd;
  put(fd, "{\"m\":\"welcome\",\"protocol\":\"wire/1\",\"rover\":\"c\",\"run\":%s,\"boot\":%lld,\"first\":%lld,"
      "\"last\":%lld,\"t\":%lld,\"rate\":1}", run, boot, last + 1 - event_count, last, clock_ms());
  again(have);
}

static void begin(command_t *command, const char *m) {
  const char *seconds = member(member(m, "parameters"), "duration_s");
  double s = seconds ? strtod(seconds, NULL) : 0;
  if (!is(member(m, "action"), "wait") || !isfinite(s))
    over(command, "\"e\":\"result\",\"success\":false,\"reason\":\"this rover can only wait\",\"values\":{}");
  else
    command->end = clock_ms() + (long long)(1000 * s);
}

static void hear(const char *m, int fd) {
  const char *kind = member(m, "m");
  char id[ID] = "", q[40] = "null";
  copy(member(m, "q"), q, sizeof q);
  copy(member(m, "id"), id, sizeof id);
  for (char *from = id, *to = id; ; from++) { /* ids are compared as text, so without blanks outside strings */
    static int quoted;
    if (from == id) quoted = 0;
    if (*from == '"' && (from == id || from[-1] != '\\')) quoted = !quoted;
    if (quoted || !isspace((unsigned char)*from)) *to++ = *from;
    if (!*from) break;
  }
  command_t *command = *id ? find(id) : NULL;
  if (is(kind, "hello")) hello(m, fd);
  else if (is(kind, "stop")) {
    for (int k = 0; k < command_count; k++)
      if (!commands[k].done) over(&commands[k], "\"e\":\"acknowledgement\"");
    put(fd, "{\"m\":\"stopped\"}");
  } else if (fd != active) return;
  else if (is(kind, "send") || is(kind, "abort")) {
    if (!*id) return;
    int fresh = !command;
    if (fresh) command = add(id);
    if (is(kind, "abort")) { if (!command->done) over(command, "\"e\":\"acknowledgement\""); }
    else if (fresh) begin(command, m);
    put(fd, "{\"m\":\"command\",\"id\":%s,\"state\":\"%s\"}", id, command->done ? "done" : "running");
  } else if (is(kind, "status")) {
    if (command && command->done)
      put(fd, "{\"m\":\"status\",\"q\":%s,\"id\":%s,\"state\":\"done\",\"result\":{%s}}", q, id, command->answer);
    else
      put(fd, "{\"m\":\"status\",\"q\":%s,\"id\":%s,\"state\":\"%s\"}", q, id, command ? "running" : "unknown");
  } else if (is(kind, "state")) put(fd, "{\"m\":\"state\",\"q\":%s,\"t\":%lld,\"values\":%s}", q, clock_ms(), state());
  else if (is(kind, "since")) again(whole(member(m, "number")));
  else if (is(kind, "commit")) forget(whole(member(m, "number")));
  else if (is(kind, "beat"))
    put(fd, "{\"m\":\"beat\",\"echo\":%lld,\"t\":%lld,\"last\":%lld}", whole(member(m, "t")), clock_ms(), last);
  else if (is(kind, "fetch")) {
    char path[ID];
    if (copy(member(m, "path"), path, sizeof path))
      put(fd, "{\"m\":\"chunk\",\"q\":%s,\"path\":%s,\"offset\":0,\"total\":null,\"data\":\"\"}", q, path);
  }
}

static void hang_up(line_t *line) {
  if (line->fd == active) active = -1;
  close(line->fd);
  free(line->data);
  memset(line, 0, sizeof *line);
  line->fd = -1;
}

static int read_line(line_t *line) { /* 0: the line is over */
  unsigned char buffer[65536];
  ssize_t got = recv(line->fd, buffer, sizeof buffer, 0);
  if (got <= 0) return 0;
  line->data = realloc(line->data, line->size + (size_t)got + 1);
  memcpy(line->data + line->size, buffer, (size_t)got);
  line->size += (size_t)got;
  while (line->size >= 4) {
    unsigned char *d = line->data;
    size_t size = (size_t)d[0] << 24 | (size_t)d[1] << 16 | (size_t)d[2] << 8 | d[3];
    if (!size || size > LIMIT) return 0;
    if (line->size < 4 + size) return 1;
    char *text = malloc(size + 1);
    memcpy(text, d + 4, size);
    text[size] = 0;
    const char *end = skip(text, 0);
    int sound = *skip_space(text) == '{' && end && !*skip_space(end);
    if (sound) hear(text, line->fd);
    free(text);
    if (!sound) return 0;
    memmove(d, d + 4 + size, line->size - 4 - size);
    line->size -= 4 + size;
  }
  return 1;
}

int main(int count, char **arguments) {
  struct sockaddr_un place = {.sun_family = AF_UNIX};
  if (count != 2 || strlen(arguments[1]) >= sizeof place.sun_path) return 2;
  strcpy(place.sun_path, arguments[1]);
  unlink(arguments[1]);
  umask(0177);
  int door = socket(AF_UNIX, SOCK_STREAM, 0);
  if (bind(door, (struct sockaddr *)&place, sizeof place) || listen(door, LINES)) { perror("socket"); return 1; }
  boot = last = (long long)time(NULL) << 20;
  for (int k = 0; k < LINES; k++) lines[k].fd = -1;
  say("\"e\":\"update\",\"t\":%lld,\"values\":%s}", clock_ms(), state());
  for (;;) {
    struct pollfd watched[LINES + 1] = {{.fd = door, .events = POLLIN}};
    for (int k = 0; k < LINES; k++) watched[k + 1] = (struct pollfd){.fd = lines[k].fd, .events = POLLIN};
    poll(watched, LINES + 1, 5);
    if (watched[0].revents) {
      int fd = accept(door, NULL, NULL), k = 0;
      while (k < LINES && lines[k].fd >= 0) k++;
      if (fd >= 0 && k < LINES) lines[k].fd = fd;
      else if (fd >= 0) close(fd);
    }
    for (int k = 0; k < LINES; k++)
      if (lines[k].fd >= 0 && watched[k + 1].fd == lines[k].fd && watched[k + 1].revents && !read_line(&lines[k]))
        hang_up(&lines[k]);
    for (int k = 0; k < command_count; k++)
      if (!commands[k].done && commands[k].end <= clock_ms())
        over(&commands[k], "\"e\":\"result\",\"success\":true,\"reason\":\"\",\"values\":{}");
  }
}
