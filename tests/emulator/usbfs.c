/* Runs a program that finds emulated devices on its USB: `usbfs FOLDER... -- PROGRAM ARGUMENT...`
 *
 * Each FOLDER is one of bridge.mjs: `descriptors` and `names` say what the device shows, the socket `usb` carries
 * requests (urbs.mjs), and `tty`, if it is there, is the terminal behind its serial port. The program runs with
 * umockdev's preloaded library, so that what it does with /sys and /dev/bus/usb ends here: libusb meets the kernel's
 * interface, usbdevfs, and whatever stands on libusb is tested unchanged. No kernel module, no rights are needed.
 *
 * Devices are /dev/bus/usb/001/002 and up, serial ports /dev/ttyACM0 and up. A device whose socket ends is unplugged: its
 * requests fail as Linux fails them, and the next program, or the same one, that opens and claims it gets a new socket.
 *
 * Limits: interrupt and isochronous transfers, alternate settings. A claimed interface is claimed until its program
 * lets go of it or ends.
 */

#include <errno.h>
#include <glib-unix.h>
#include <gio/gio.h>
#include <linux/usbdevice_fs.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <umockdev.h>
#include <unistd.h>

enum { SUBMIT, CANCEL, RESET };

/* A program that finds nothing to reap is told so after this; meanwhile it waits as it would in poll(). */
#define REAP_PATIENCE_MS 2
#define INTERFACES 32

struct device {
    const char *folder;
    char *node;
    UMockdevIoctlBase *handler;
    int socket; /* -1 while unplugged */
    guint watch;
    GByteArray *answers;          /* what has come of an answer */
    GList *flying;                /* struct urb, submitted */
    GList *done;                  /* struct urb, answered and not reaped */
    UMockdevIoctlClient *reaping; /* waits for one of them */
    guint patience;
    UMockdevIoctlClient *claims[INTERFACES];
};

struct urb {
    uint32_t id;
    UMockdevIoctlClient *client;
    UMockdevIoctlData *data;   /* struct usbdevfs_urb; NULL for a request of our own */
    UMockdevIoctlData *buffer; /* NULL if it has none */
};

static uint32_t last_id;

/* umockdev calls from a thread of its own; what comes of it, and time, come to the main thread. */
static GRecMutex lock;
#define LOCKED g_autoptr(GRecMutexLocker) locked = g_rec_mutex_locker_new(&lock); (void)locked

static void put32(uint8_t *to, uint32_t value)
{
    for (int i = 0; i < 4; i++) to[i] = value >> 8 * i;
}

static uint32_t get32(const uint8_t *from)
{
    return from[0] | from[1] << 8 | from[2] << 16 | (uint32_t)from[3] << 24;
}

static void complete(UMockdevIoctlClient *client, int error)
{
    umockdev_ioctl_client_complete(client, error ? -1 : 0, error);
}

static void urb_free(struct urb *urb)
{
    g_clear_object(&urb->client);
    if (urb->data) umockdev_ioctl_data_unref(urb->data);
    if (urb->buffer) umockdev_ioctl_data_unref(urb->buffer);
    g_free(urb);
}

static gboolean send_all(struct device *device, const void *bytes, size_t length)
{
    for (const char *at = bytes; length > 0;) {
        ssize_t count = send(device->socket, at, length, MSG_NOSIGNAL);
        if (count < 0) return FALSE;
        at += count;
        length -= count;
    }
    return TRUE;
}

/* Sends a request; false if the device is gone. */
static gboolean request(struct device *device, uint32_t id, int what, int type, int endpoint, int flags,
                        uint32_t length, const void *attached, uint32_t count)
{
    uint8_t head[16];
    put32(head, id);
    head[4] = what;
    head[5] = type;
    head[6] = endpoint;
    head[7] = flags;
    put32(head + 8, length);
    put32(head + 12, count);
    return device->socket >= 0 && send_all(device, head, sizeof head) && send_all(device, attached, count);
}

/* Gives a request that has been answered to whoever reaps. */
static void reap(struct device *device)
{
    struct urb *urb = NULL;
    for (GList *link = device->done; link && device->reaping; link = link->next) {
        urb = link->data;
        if (urb->client != device->reaping) continue;
        UMockdevIoctlClient *client = g_steal_pointer(&device->reaping);
        g_clear_handle_id(&device->patience, g_source_remove);
        UMockdevIoctlData *arg = umockdev_ioctl_client_get_arg(client);
        UMockdevIoctlData *pointer = umockdev_ioctl_data_resolve(arg, 0, sizeof(void *), NULL);
        umockdev_ioctl_data_set_ptr(pointer, 0, urb->data);
        complete(client, 0);
        umockdev_ioctl_data_unref(pointer);
        g_object_unref(client);
        device->done = g_list_delete_link(device->done, link);
        urb_free(urb);
        return;
    }
}

static gboolean nothing_to_reap(gpointer user)
{
    LOCKED;
    struct device *device = user;
    UMockdevIoctlClient *client = g_steal_pointer(&device->reaping);
    /* Answered while this waited for its turn. */
    if (!client) return G_SOURCE_REMOVE;
    device->patience = 0;
    complete(client, device->socket < 0 ? ENODEV : EAGAIN);
    g_object_unref(client);
    return G_SOURCE_REMOVE;
}

static void finish(struct device *device, struct urb *urb, int status, const uint8_t *bytes, uint32_t length)
{
    device->flying = g_list_remove(device->flying, urb);
    if (!urb->data) {
        complete(urb->client, -status);
        urb_free(urb);
        return;
    }
    struct usbdevfs_urb *kernel = (struct usbdevfs_urb *)urb->data->data;
    uint32_t head = kernel->type == USBDEVFS_URB_TYPE_CONTROL ? 8 : 0;
    kernel->status = status;
    kernel->actual_length = length;
    if (bytes && urb->buffer) memcpy(urb->buffer->data + head, bytes, MIN(length, kernel->buffer_length - head));
    device->done = g_list_append(device->done, urb);
    reap(device);
}

static void unplugged(struct device *device)
{
    if (device->socket < 0) return;
    g_clear_handle_id(&device->watch, g_source_remove);
    close(device->socket);
    device->socket = -1;
    while (device->flying) finish(device, device->flying->data, -ESHUTDOWN, NULL, 0);
}

static gboolean answered(gint fd, GIOCondition condition, gpointer user)
{
    LOCKED;
    struct device *device = user;
    uint8_t piece[4096];
    ssize_t count = recv(fd, piece, sizeof piece, 0);
    (void)condition;
    if (count <= 0) {
        device->watch = 0;
        unplugged(device);
        return G_SOURCE_REMOVE;
    }
    g_byte_array_append(device->answers, piece, count);
    for (;;) {
        const uint8_t *head = device->answers->data;
        if (device->answers->len < 16) break;
        uint32_t id = get32(head), length = get32(head + 8), follow = get32(head + 12);
        if (device->answers->len < 16 + follow) break;
        for (GList *link = device->flying; link; link = link->next) {
            struct urb *urb = link->data;
            if (urb->id != id) continue;
            finish(device, urb, (int32_t)get32(head + 4), follow ? head + 16 : NULL, length);
            break;
        }
        g_byte_array_remove_range(device->answers, 0, 16 + follow);
    }
    return G_SOURCE_CONTINUE;
}

static gboolean plug(struct device *device)
{
    if (device->socket >= 0) return TRUE;
    struct sockaddr_un address = { .sun_family = AF_UNIX };
    g_autofree char *path = g_build_filename(device->folder, "usb", NULL);
    if (g_strlcpy(address.sun_path, path, sizeof address.sun_path) >= sizeof address.sun_path) return FALSE;
    int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (fd < 0 || connect(fd, (struct sockaddr *)&address, sizeof address) < 0) {
        if (fd >= 0) close(fd);
        return FALSE;
    }
    device->socket = fd;
    g_byte_array_set_size(device->answers, 0);
    device->watch = g_unix_fd_add(fd, G_IO_IN | G_IO_HUP, answered, device);
    return TRUE;
}

/* A request of the kernel's own, whose end ends the program's call. */
static void own_request(struct device *device, UMockdevIoctlClient *client, int what, const uint8_t setup[8])
{
    struct urb *urb = g_new0(struct urb, 1);
    urb->id = ++last_id;
    urb->client = g_object_ref(client);
    device->flying = g_list_append(device->flying, urb);
    if (!request(device, urb->id, what, USBDEVFS_URB_TYPE_CONTROL, 0, 0, 8, setup, setup ? 8 : 0)) {
        device->flying = g_list_remove(device->flying, urb);
        complete(client, ENODEV);
        urb_free(urb);
    }
}

static void submit(struct device *device, UMockdevIoctlClient *client, UMockdevIoctlData *arg)
{
    struct urb *urb = g_new0(struct urb, 1);
    urb->id = ++last_id;
    urb->client = g_object_ref(client);
    urb->data = umockdev_ioctl_data_resolve(arg, 0, sizeof(struct usbdevfs_urb), NULL);
    struct usbdevfs_urb *kernel = (struct usbdevfs_urb *)urb->data->data;
    if (kernel->type != USBDEVFS_URB_TYPE_BULK && kernel->type != USBDEVFS_URB_TYPE_CONTROL) {
        complete(client, EINVAL);
        urb_free(urb);
        return;
    }
    if (kernel->buffer_length > 0)
        urb->buffer = umockdev_ioctl_data_resolve(urb->data, G_STRUCT_OFFSET(struct usbdevfs_urb, buffer),
                                                  kernel->buffer_length, NULL);
    const uint8_t *bytes = urb->buffer ? urb->buffer->data : NULL;
    uint32_t attached = kernel->buffer_length;
    gboolean control = kernel->type == USBDEVFS_URB_TYPE_CONTROL;
    if (control && attached > 8 && bytes[0] & 0x80) attached = 8;
    if (!control && kernel->endpoint & 0x80) attached = 0;
    if (!request(device, urb->id, SUBMIT, kernel->type, kernel->endpoint, kernel->flags, kernel->buffer_length, bytes,
                 attached)) {
        complete(client, ENODEV);
        urb_free(urb);
        return;
    }
    device->flying = g_list_append(device->flying, urb);
    complete(client, 0);
}

static void discard(struct device *device, UMockdevIoctlClient *client, gulong address)
{
    for (GList *link = device->flying; link; link = link->next) {
        struct urb *urb = link->data;
        if (urb->client != client || !urb->data || urb->data->client_addr != address) continue;
        request(device, urb->id, CANCEL, 0, 0, 0, 0, NULL, 0);
        complete(client, 0);
        return;
    }
    complete(client, EINVAL);
}

/* The program has closed the device, or ended: what it had under way is nobody's any more. */
static void closed(GObject *object, GParamSpec *property, gpointer user)
{
    LOCKED;
    struct device *device = user;
    UMockdevIoctlClient *client = UMOCKDEV_IOCTL_CLIENT(object);
    (void)property;
    if (umockdev_ioctl_client_get_connected(client)) return;
    for (int i = 0; i < INTERFACES; i++)
        if (device->claims[i] == client) device->claims[i] = NULL;
    if (device->reaping == client) {
        g_clear_handle_id(&device->patience, g_source_remove);
        g_clear_object(&device->reaping);
    }
    GList **lists[] = { &device->flying, &device->done };
    for (int i = 0; i < 2; i++) {
        for (GList *link = *lists[i], *next; link; link = next) {
            struct urb *urb = link->data;
            next = link->next;
            if (urb->client != client) continue;
            if (i == 0) request(device, urb->id, CANCEL, 0, 0, 0, 0, NULL, 0);
            *lists[i] = g_list_delete_link(*lists[i], link);
            urb_free(urb);
        }
    }
}

static unsigned number(UMockdevIoctlData *arg)
{
    UMockdevIoctlData *data = umockdev_ioctl_data_resolve(arg, 0, sizeof(unsigned), NULL);
    unsigned value = *(unsigned *)data->data;
    umockdev_ioctl_data_unref(data);
    return value;
}

static gboolean handle(UMockdevIoctlBase *base, UMockdevIoctlClient *client, gpointer user)
{
    LOCKED;
    struct device *device = user;
    UMockdevIoctlData *arg = umockdev_ioctl_client_get_arg(client);
    gulong code = umockdev_ioctl_client_get_request(client);
    (void)base;
    if (!g_object_get_data(G_OBJECT(client), "known")) {
        g_object_set_data(G_OBJECT(client), "known", device);
        g_signal_connect(client, "notify::connected", G_CALLBACK(closed), device);
    }
    switch (code) {
    case USBDEVFS_GET_CAPABILITIES: {
        UMockdevIoctlData *data = umockdev_ioctl_data_resolve(arg, 0, sizeof(uint32_t), NULL);
        uint32_t abilities = USBDEVFS_CAP_ZERO_PACKET | USBDEVFS_CAP_NO_PACKET_SIZE_LIM | USBDEVFS_CAP_REAP_AFTER_DISCONNECT;
        umockdev_ioctl_data_update(data, 0, (guint8 *)&abilities, sizeof abilities);
        umockdev_ioctl_data_unref(data);
        complete(client, 0);
        return TRUE;
    }
    case USBDEVFS_CLAIMINTERFACE: {
        unsigned interface = number(arg);
        if (interface >= INTERFACES) complete(client, EINVAL);
        else if (!plug(device)) complete(client, ENODEV);
        else if (device->claims[interface] && device->claims[interface] != client) complete(client, EBUSY);
        else {
            device->claims[interface] = client;
            complete(client, 0);
        }
        return TRUE;
    }
    case USBDEVFS_RELEASEINTERFACE: {
        unsigned interface = number(arg);
        gboolean ours = interface < INTERFACES && device->claims[interface] == client;
        if (ours) device->claims[interface] = NULL;
        complete(client, ours ? 0 : EINVAL);
        return TRUE;
    }
    case USBDEVFS_GETDRIVER:
        complete(client, ENODATA);
        return TRUE;
    case USBDEVFS_SETCONFIGURATION:
    case USBDEVFS_SETINTERFACE:
        complete(client, 0);
        return TRUE;
    case USBDEVFS_CLEAR_HALT: {
        /* CLEAR_FEATURE(ENDPOINT_HALT) */
        const uint8_t setup[8] = { 0x02, 1, 0, 0, number(arg), 0, 0, 0 };
        own_request(device, client, SUBMIT, setup);
        return TRUE;
    }
    case USBDEVFS_RESET:
        own_request(device, client, RESET, NULL);
        return TRUE;
    case USBDEVFS_SUBMITURB:
        if (plug(device)) submit(device, client, arg);
        else complete(client, ENODEV);
        return TRUE;
    case USBDEVFS_REAPURB:
    case USBDEVFS_REAPURBNDELAY:
        if (device->reaping) {
            complete(client, EAGAIN);
            return TRUE;
        }
        device->reaping = g_object_ref(client);
        device->patience = g_timeout_add(REAP_PATIENCE_MS, nothing_to_reap, device);
        reap(device);
        return TRUE;
    case USBDEVFS_DISCARDURB:
        discard(device, client, *(gulong *)arg->data);
        return TRUE;
    default:
        complete(client, ENOTTY);
        return TRUE;
    }
}

/* A serial port is a real terminal: its calls are the system's. */
static gboolean let_pass(UMockdevIoctlBase *base, UMockdevIoctlClient *client, gpointer user)
{
    int error = 0;
    (void)base;
    (void)user;
    int result = umockdev_ioctl_client_execute(client, &error, NULL);
    umockdev_ioctl_client_complete(client, result, error);
    return TRUE;
}

static char *read_file(const char *folder, const char *name, gsize *length)
{
    g_autofree char *path = g_build_filename(folder, name, NULL);
    g_autoptr(GError) error = NULL;
    char *bytes = NULL;
    if (!g_file_get_contents(path, &bytes, length, &error)) {
        g_printerr("usbfs: %s\n", error->message);
        exit(2);
    }
    return bytes;
}

static void add(UMockdevTestbed *testbed, struct device *device, int index)
{
    gsize length;
    g_autofree uint8_t *descriptors = (uint8_t *)read_file(device->folder, "descriptors", &length);
    g_autofree char *text = read_file(device->folder, "names", NULL);
    g_auto(GStrv) names = g_strsplit(text, "\n", 4);
    g_autofree char *tty = g_build_filename(device->folder, "tty", NULL);
    g_autofree char *root = umockdev_testbed_get_root_dir(testbed);
    g_autoptr(GError) error = NULL;
    if (length < 18 || g_strv_length(names) < 3) {
        g_printerr("usbfs: %s: `descriptors` or `names` is cut short\n", device->folder);
        exit(2);
    }
    device->node = g_strdup_printf("/dev/bus/usb/001/%03d", index + 2);
    g_autoptr(GString) what = g_string_new(NULL);
    g_string_append_printf(what,
                           "P: /devices/usb1/1-%d\nN: bus/usb/001/%03d\nE: SUBSYSTEM=usb\nE: DEVTYPE=usb_device\n"
                           "E: BUSNUM=001\nE: DEVNUM=%03d\nE: DEVNAME=%s\nA: busnum=1\\n\nA: devnum=%d\\n\n"
                           "A: speed=12\\n\nA: bConfigurationValue=1\\n\nA: idVendor=%02x%02x\\n\nA: idProduct=%02x%02x\\n\n"
                           "A: manufacturer=%s\\n\nA: product=%s\\n\nA: serial=%s\\n\nH: descriptors=",
                           index + 1, index + 2, index + 2, device->node, index + 2, descriptors[9], descriptors[8],
                           descriptors[11], descriptors[10], names[0], names[1], names[2]);
    for (gsize i = 0; i < length; i++) g_string_append_printf(what, "%02x", descriptors[i]);
    g_string_append(what, "\n");
    gboolean serial = g_file_test(tty, G_FILE_TEST_EXISTS);
    if (serial)
        g_string_append_printf(what,
                               "\nP: /devices/usb1/1-%d/1-%d:1.0\nE: SUBSYSTEM=usb\nE: DEVTYPE=usb_interface\n"
                               "A: bInterfaceNumber=00\\n\n"
                               "\nP: /devices/usb1/1-%d/1-%d:1.0/tty/ttyACM%d\nE: SUBSYSTEM=tty\n"
                               "L: device=../../../1-%d:1.0\n",
                               index + 1, index + 1, index + 1, index + 1, index, index + 1);
    if (!umockdev_testbed_attach_ioctl(testbed, device->node, device->handler, &error)
        || !umockdev_testbed_add_from_string(testbed, what->str, &error)) {
        g_printerr("usbfs: %s\n", error->message);
        exit(2);
    }
    g_autofree char *port = g_strdup_printf("%s/dev/ttyACM%d", root, index);
    if (!serial) return;
    UMockdevIoctlBase *terminal = umockdev_ioctl_base_new();
    g_signal_connect(terminal, "handle-ioctl", G_CALLBACK(let_pass), NULL);
    g_autofree char *name = g_strdup_printf("/dev/ttyACM%d", index);
    if (symlink(tty, port) < 0 || !umockdev_testbed_attach_ioctl(testbed, name, terminal, &error)) {
        g_printerr("usbfs: %s: %s\n", name, error ? error->message : g_strerror(errno));
        exit(2);
    }
}

static int result;

static void ended(GPid pid, gint status, gpointer loop)
{
    (void)pid;
    result = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
    g_main_loop_quit(loop);
}

/* Who ends us ends the program, without a word. */
static gboolean pass_on(gpointer pid)
{
    kill(GPOINTER_TO_INT(pid), SIGKILL);
    return G_SOURCE_CONTINUE;
}

int main(int argc, char **argv)
{
    int count = 0;
    while (count + 1 < argc && strcmp(argv[count + 1], "--") != 0) count++;
    char **program = argv + count + 2;
    if (count == 0 || count + 2 >= argc) {
        g_printerr("usage: usbfs FOLDER... -- PROGRAM ARGUMENT...\n");
        return 2;
    }
    g_autoptr(UMockdevTestbed) testbed = umockdev_testbed_new();
    struct device *devices = g_new0(struct device, count);
    for (int i = 0; i < count; i++) {
        devices[i].folder = argv[i + 1];
        devices[i].socket = -1;
        devices[i].answers = g_byte_array_new();
        devices[i].handler = umockdev_ioctl_base_new();
        g_signal_connect(devices[i].handler, "handle-ioctl", G_CALLBACK(handle), &devices[i]);
        add(testbed, &devices[i], i);
    }
    g_autoptr(GMainLoop) loop = g_main_loop_new(NULL, FALSE);
    g_auto(GStrv) environment = g_environ_setenv(g_get_environ(), "LD_PRELOAD", "libumockdev-preload.so.0", TRUE);
    g_autoptr(GError) error = NULL;
    GPid pid;
    if (!g_spawn_async(NULL, program, environment,
                       G_SPAWN_SEARCH_PATH | G_SPAWN_DO_NOT_REAP_CHILD | G_SPAWN_CHILD_INHERITS_STDIN, NULL, NULL, &pid,
                       &error)) {
        g_printerr("usbfs: %s\n", error->message);
        return 2;
    }
    g_child_watch_add(pid, ended, loop);
    g_unix_signal_add(SIGTERM, pass_on, GINT_TO_POINTER(pid));
    g_main_loop_run(loop);
    return result;
}
