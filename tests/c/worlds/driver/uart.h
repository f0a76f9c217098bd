/* What the examples use of ESP-IDF. */
#include <stddef.h>
#include <stdint.h>
typedef int esp_err_t;
typedef struct {
    int baud_rate, data_bits, parity, stop_bits, flow_ctrl;
} uart_config_t;
enum { UART_NUM_1, UART_DATA_8_BITS, UART_PARITY_DISABLE, UART_STOP_BITS_1, UART_HW_FLOWCTRL_DISABLE };
#define ESP_ERROR_CHECK(call) ((void)(call))
esp_err_t uart_driver_install(int port, int rx, int tx, int queue_size, void *queue, int flags);
esp_err_t uart_param_config(int port, const uart_config_t *settings);
int uart_write_bytes(int port, const void *bytes, size_t size);
int uart_read_bytes(int port, void *bytes, uint32_t size, uint32_t ticks);
void app_main(void);
