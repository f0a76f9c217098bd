/* The proof of a master. @p@ and @P@ are replaced by the protocol's name; the invariant of its receiver, `holds`, is defined
 * in the file for its kind. Each call from any state that satisfies the invariant is memory-safe and leads to such a state, and so
 * does the initial one: together that is memory safety for any calls in any order, at any times. */
#include "@p@_master.h"

int nondet_int(void);
#define REACHED(condition) (void)(condition)

uint8_t nondet_byte(void);
uint32_t nondet_time(void);
bool nondet_bool(void);
size_t nondet_size(void);
@p@_bus_t nondet_bus(void);
@p@_job_t nondet_job(void);

@invariant@

static @p@_job_t present;
static @p@_job_t queued;
static @p@_job_t other;
static @request@ request;
static @response@ response;

/* What the program does is not known; it may ask again. */
static void send(@p@_bus_t *bus, const uint8_t *bytes, size_t size)
{
    __CPROVER_assert(size >= 1u && size <= sizeof bus->wire && bytes == bus->wire, "what is sent is a frame");
}

static void done(@p@_bus_t *bus, @p@_job_t *job)
{
    (void)bus;
    __CPROVER_assert(job->outcome != @P@_OUTCOME_WAITING, "a job has ended when its function is called");
}

/* The functions of a command, whose codec has proofs of its own. */
static int encode(const @p@_job_t *job, uint8_t *wire, size_t capacity)
{
    const int size = nondet_int();
    (void)job;
    __CPROVER_assume(size <= (int)capacity);
    if (size > 0) {
        wire[size - 1] = nondet_byte();
    }
    return size;
}

static @p@_means_t means(@p@_bus_t *bus, const @p@_job_t *job, const @p@_frame_t *frame)
{
    const int found = nondet_int();
    (void)bus;
    (void)job;
    (void)frame;
    __CPROVER_assume((found >= (int)@P@_MEANS_NONE_) && (found <= (int)@P@_MEANS_PENDING_));
    return (@p@_means_t)found;
}

/* A job as the function of a command leaves it. */
static @p@_job_t made(void)
{
    @p@_job_t job = nondet_job();
    const bool answered = nondet_bool();
    job.done = nondet_bool() ? done : NULL;
    job.accepts = NULL;
    job.request = &request;
    job.response = nondet_bool() ? &response : NULL;
    job.encode = encode;
    job.means = answered ? means : NULL;
    job.kind = answered ? @P@_ANSWERED_ : 0U;
    job.next = NULL;
    job.answer = NULL;
    job.outcome = @P@_OUTCOME_WAITING;
    return job;
}

static bool master_holds(const @p@_bus_t *bus)
{
    const bool idle = bus->state == @P@_BUS_IDLE_;
    const bool waits = bus->state == @P@_BUS_WAITING_;
    return bus->state <= @P@_BUS_WAITING_ && bus->send == send && bus->baud >= 1U && holds(&bus->receiver) &&
        (idle ? (bus->job == NULL) : (bus->job == &present && bus->size >= 1U && present.outcome == @P@_OUTCOME_WAITING)) &&
        (!waits || (present.means != NULL && (present.kind & @P@_ANSWERED_) != 0U)) && bus->size <= sizeof bus->wire &&
        (!bus->echoing || (bus->size >= 1U && bus->echoed < bus->size)) &&
        (!bus->broken || (bus->echoing && bus->matched <= bus->size)) &&
        ((bus->first == NULL) || (bus->first == &queued && bus->last == &queued && queued.next == NULL));
}

static @p@_bus_t any(void)
{
    @p@_bus_t bus = nondet_bus();
    present = made();
    queued = made();
    bus.send = send;
    bus.job = nondet_bool() ? &present : NULL;
    bus.first = nondet_bool() ? &queued : NULL;
    bus.last = &queued;
    __CPROVER_assume(bus.size <= @most@u);
    bus.baud = 115200u; /* any other one only makes the proof longer: it is a divisor, and never 0 */
    __CPROVER_assume(master_holds(&bus));
    return bus;
}

/* As `master_holds`, but the queued job may be the present one now, and there may be another one in the queue. */
static void kept(const @p@_bus_t *bus)
{
    __CPROVER_assert(bus->state <= @P@_BUS_WAITING_, "a known state");
    __CPROVER_assert((bus->state == @P@_BUS_IDLE_) == (bus->job == NULL), "a job unless idle");
    __CPROVER_assert(bus->job == NULL || bus->job == &present || bus->job == &queued, "a job of the queue");
    __CPROVER_assert(bus->job == NULL || (bus->size >= 1U && bus->size <= sizeof bus->wire), "a frame to send");
    __CPROVER_assert(bus->state != @P@_BUS_WAITING_ || bus->job->means != NULL, "only answered requests wait");
    __CPROVER_assert(!bus->echoing || (bus->echoed < bus->size), "an echo within the frame");
    __CPROVER_assert(!bus->broken || (bus->echoing && bus->matched <= bus->size), "only an awaited echo is changed");
    __CPROVER_assert(holds(&bus->receiver), "a receiver that holds");
}

void start(void)
{
    @p@_bus_t bus = nondet_bus();
    const uint32_t baud = nondet_time();
    __CPROVER_assume(baud >= 1U);
    @p@_bus_init(&bus, baud, nondet_time(), send, nondet_time());
    __CPROVER_assert(master_holds(&bus), "a master starts in a state that satisfies the invariant");
}

void receive(void)
{
    @p@_bus_t bus = any();
    __CPROVER_assume(!bus.echoing);
    @p@_bus_receive(&bus, nondet_byte(), nondet_time());
    kept(&bus);
}

/* A byte of an echo: it is one, or is compared with the request. That bytes go to the receiver is proven by `receive`. */
void match(void)
{
    @p@_bus_t bus = any();
    __CPROVER_assume(bus.broken);
    bus.matched = @p@_bus_matched_(&bus, nondet_byte());
    kept(&bus);
}

void poll(void)
{
    @p@_bus_t bus = any();
    @p@_bus_poll(&bus, nondet_time());
    kept(&bus);
    (void)@p@_bus_wait(&bus, nondet_time());
}

void give_up(void)
{
    @p@_bus_t bus = any();
    @p@_job_t *const job = nondet_bool() ? &present : (nondet_bool() ? &queued : &other);
    __CPROVER_assume((bus.job == &present) || (job != &present));
    @p@_bus_abort(&bus, job, nondet_time());
    kept(&bus);
}

void ask(void)
{
    @p@_bus_t bus = any();
    __CPROVER_assume(bus.inside); /* otherwise `poll` follows, which is proven */
    other = made();
    other.outcome = nondet_bool() ? @P@_OUTCOME_NONE : @P@_OUTCOME_DONE;
    (void)@p@_ask_@ask@(&bus, &other, nondet_byte(), &request, &response, nondet_time());
    __CPROVER_assert(other.outcome != @P@_OUTCOME_NONE, "it waits, or is as before");
    __CPROVER_assert(bus.first != NULL && bus.last == &other && other.next == NULL, "it is the last one of the queue");
    kept(&bus);
}
