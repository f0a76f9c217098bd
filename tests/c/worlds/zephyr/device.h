/* What the examples use of Zephyr. */
struct device;
extern const struct device zephyr_console_device;
#define DT_CHOSEN(name) name##_device
#define DEVICE_DT_GET(node) (&node)
